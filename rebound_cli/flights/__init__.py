"""Flights on disk: which are kept, and `rebound logs`."""
