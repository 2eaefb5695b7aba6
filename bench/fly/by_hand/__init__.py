"""Vehicles that are flown by sticks, each step watched by guards."""
