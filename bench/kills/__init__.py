"""What becomes of a vehicle whose companion is killed, at random instants around a hit."""
