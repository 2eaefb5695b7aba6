"""The flight itself: states, mission progress, commands, authority, and the setpoint stream."""
