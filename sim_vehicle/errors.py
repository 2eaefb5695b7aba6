"""What can go wrong around the simulated vehicle; every message is one sentence for a person."""


class SimulationError(Exception):
    """Root of the family; the command line prints its message and exits non-zero."""


class AirframeError(SimulationError):
    """An airframe that does not exist or cannot fly."""


class SceneError(SimulationError):
    """A simulated world in which the vehicle cannot start."""


class ParameterError(SimulationError):
    """A parameter that the vehicle does not have."""


class PortInUse(SimulationError):  # noqa: N818 - reads as the sentence it is
    """The port on which the vehicle listens cannot be had."""


class LinkAddressError(SimulationError):
    """An address that names no link of the simulated vehicle."""


class NotInLockstep(SimulationError):  # noqa: N818 - reads as the sentence it is
    """A PX4 that keeps its own time instead of the simulator's."""


class FaultError(SimulationError):
    """A fault that cannot be injected as asked."""


class VehicleEnded(SimulationError):  # noqa: N818 - reads as the sentence it is
    """A vehicle that is asked something after it was stopped or came to grief."""


class ConditionNotMet(SimulationError, AssertionError):  # noqa: N818 - reads as the sentence it is
    """What a test waited for did not happen in time."""
