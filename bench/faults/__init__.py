"""Faults and attacks: what is done to a flight, what is expected of it, and what became of many."""
