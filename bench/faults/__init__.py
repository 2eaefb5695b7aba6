"""Faults and attacks, one file a kind: what is done to a flight, and what is expected of it."""
