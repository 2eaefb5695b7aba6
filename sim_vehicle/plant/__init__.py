"""The plant: body, loops, estimator and faults, joined an IMU interval at a time."""
