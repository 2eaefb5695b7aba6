"""`flight.png`, the picture of a flight."""
