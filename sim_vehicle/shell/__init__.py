"""The thin shell of the simulated vehicle: sockets, the clock and files."""
