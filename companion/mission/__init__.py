"""The mission a person writes, as a validated model."""
