"""What is done in each state of the flight."""
