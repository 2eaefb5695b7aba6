"""Companion-computer application: detects a collision of a PX4 drone in one IMU sample and recovers from it.

Everything here except `companion.shell` is free of I/O: bytes and the time are arguments, bytes are the result.
"""
