"""The missions that ship: `rebound fly wall` finds them by name."""
