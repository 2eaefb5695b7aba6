"""The mission a person writes, as a validated model, and the trajectory of each of its items."""
