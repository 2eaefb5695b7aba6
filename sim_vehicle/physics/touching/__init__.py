"""Where the vehicle meets the ground and obstacles, with what force, and what becomes of a hit."""
