"""Vehicles that are flown by sticks or to the ground, each step watched by a guard."""
