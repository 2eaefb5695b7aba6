"""`rebound preflight`: the command and the card of the first flight."""
