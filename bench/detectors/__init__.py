"""Detectors of other authors, and a simpler one of our own, beside which the drone's is measured."""
