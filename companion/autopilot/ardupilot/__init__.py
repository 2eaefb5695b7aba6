"""All that is ArduPilot's: Copter's modes, parameters and their limits, defaults and time-outs."""
