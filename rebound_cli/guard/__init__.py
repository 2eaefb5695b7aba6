"""`rebound guard`: protection for a flight that something else commands."""
