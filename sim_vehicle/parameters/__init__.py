"""Parameters: PX4's names, types, units, defaults and ranges, and their values in this vehicle."""
