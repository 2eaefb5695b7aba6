"""Hits by the ten thousand through the whole wire: each vehicle begins in flight and ends at rest."""
