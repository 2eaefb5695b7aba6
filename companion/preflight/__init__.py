"""Before the first flight: what a vehicle's settings, streams and estimate say, and what to change."""
