"""Bytes to and from a vehicle, and the guard's clients: UDP, TCP, serial ports."""
