"""The simulated vehicle's body under a real PX4: sensors out, motor commands in, one for one."""
