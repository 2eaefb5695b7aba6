"""Errors a person can act on. Each message is one sentence that says what is wrong and what to do."""


class ReboundError(Exception):
    """Root of all expected errors: the command line prints the message and exits non-zero."""


class ConfigurationError(ReboundError):
    """The mission or the configuration cannot be used as written."""


class ConnectionSetupError(ReboundError):
    """The connection could not be opened: port in use, serial device missing, URL not understood."""


class AddressError(ConfigurationError, ConnectionSetupError):
    """What was given as an address is none: trying again will not help."""
