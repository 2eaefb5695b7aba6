"""The bench of the collision detectors: simulated hits and flights, recorded flights, and what each detector saw."""
