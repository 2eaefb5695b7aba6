"""What a vehicle can truly say: a value outside is a fault of a sensor, of a program or of somebody who means harm.

Every bound names its source, and is one of a vector's length.
"""

import math

# All three axes of a sensor at the end of its range at once, and a tenth more for its calibration.
_OF_RANGE = 1.1 * math.sqrt(3.0)
# 40 g is the widest range among PX4's accelerometer drivers (ADIS16470, ADIS16507).
SPECIFIC_FORCE_M_S2 = _OF_RANGE * 40.0 * 9.80665
# The widest zero-g offset among PX4's accelerometers (MPU-6000, z: 80 mg). A sensor that is off reads no more; thrust
# is more in all but free fall, which shows no contact.
ZERO_G_OFFSET_M_S2 = 0.08 * 9.80665
# 4000 deg/s is the widest range among PX4's gyroscope drivers (ICM-45686).
ANGULAR_VELOCITY_RAD_S = _OF_RANGE * math.radians(4000.0)
# EKF2 holds its own states within these: velocity_limit, and Ekf::constrainStates.
VELOCITY_M_S = 100.0
POSITION_M = 1.0e6
# Thrust is the length of a vector with three parts of at most 1 (PX4's streams/ATTITUDE_TARGET.hpp).
THRUST_FRACTION = math.sqrt(3.0)
# Microseconds are exact in double precision up to here: 285 years.
TIME_US = 1 << 53
# PX4 sends rotations in single precision, good to 1e-6; one that is further from length 1 than this is no rotation.
QUATERNION_ERROR = 1.0e-3


def within(most: float, *values: float) -> bool:
    """Whether the vector is no longer than `most`. One with NaN or an infinity is not."""
    return math.hypot(*values) <= most


def is_rotation(w: float, x: float, y: float, z: float) -> bool:
    """Whether a quaternion has length 1."""
    return abs(w * w + x * x + y * y + z * z - 1.0) <= QUATERNION_ERROR
