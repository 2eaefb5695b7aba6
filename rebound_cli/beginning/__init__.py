"""What a person begins with: a mission, a key, PX4's parameters."""
