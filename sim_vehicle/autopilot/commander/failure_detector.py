"""Whether the vehicle has tipped over: further than FD_FAIL_R or FD_FAIL_P for as long as their own times.

Source: PX4's commander/failure_detector/FailureDetector.cpp (updateAttitudeStatus).
"""

import math

from sim_vehicle.estimator.estimate import Quaternion, roll_pitch_of
from sim_vehicle.parameters.store import Parameters

# The greatest tilt and how long it has to last; a tilt of 0 or less switches the axis off.
_NAMES = (("FD_FAIL_R", "FD_FAIL_R_TTRI"), ("FD_FAIL_P", "FD_FAIL_P_TTRI"))


class TippingDetector:
    """Roll and pitch, each with a clock of its own."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._since_us: list[int | None] = [None, None]
        self.tipped_over = False

    def update(self, now_us: int, attitude_wxyz: Quaternion) -> None:
        """Judge the attitude; call it at every cycle of the failsafes."""
        tipped = False
        for axis, (angle_rad, (most, lasting)) in enumerate(zip(roll_pitch_of(attitude_wxyz), _NAMES, strict=True)):
            if not 0.0 < self._parameters[most] < abs(math.degrees(angle_rad)):
                self._since_us[axis] = None
                continue
            since_us = self._since_us[axis]
            if since_us is None:
                since_us = self._since_us[axis] = now_us
            tipped = tipped or now_us - since_us > 1e6 * self._parameters[lasting]
        self.tipped_over = tipped
