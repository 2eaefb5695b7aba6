"""Numerical kernels of the plant: motors, contact, rigid body and inertial sensor (numba)."""
