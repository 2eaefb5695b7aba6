"""Ways to fly: from an item to a trajectory, and round what is known."""
