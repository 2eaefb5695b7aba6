"""Body for a real ArduPilot: Copter's SITL with the model JSON."""
