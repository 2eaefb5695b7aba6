"""All that is PX4's: modes, parameters and their limits, defaults and time-outs."""
