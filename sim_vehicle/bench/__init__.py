"""A vehicle under test: what a test may do to it between two intervals, and what it may read. No clock, no socket."""
