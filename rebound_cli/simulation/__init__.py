"""The simulated vehicle beside the companion: as a process, in lockstep, and compiled before."""
