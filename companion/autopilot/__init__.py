"""What differs between autopilots: the interface, and a folder for each one that fills it."""
