"""`rebound preflight`: what a connected vehicle needs before its first flight."""
