"""Estimates made from telemetry, in the vehicle's boot clock: motion history, collision velocity, settling."""
