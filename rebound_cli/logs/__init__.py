"""Flights others recorded, as the samples the wire would have carried: PX4's .ulg, MAVLink's .tlog, our run folders."""
