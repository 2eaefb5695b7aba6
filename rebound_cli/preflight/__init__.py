"""`rebound preflight`."""
