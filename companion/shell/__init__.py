"""The companion's edge to the world: connections, the clock, the telemetry log."""
