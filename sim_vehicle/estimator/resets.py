"""When the filter stops believing itself: nothing fused for too long, and a good sample at hand.

PX4 does the same (EKF2's `no_aid_timeout_max`, optical_flow_control.cpp) and counts each reset in
ODOMETRY.reset_counter, so that whoever flies by the estimate knows that it has jumped.
"""


class ResetClock:
    """One thing that can be lost and found: velocity, height or position."""

    def __init__(self, after_s: float, now_us: int) -> None:
        self._after_us = round(1e6 * after_s)
        self._fused_us = now_us

    def fused(self, now_us: int) -> None:
        """It was aided, or reset."""
        self._fused_us = now_us

    def is_due(self, now_us: int) -> bool:
        """Whether the aid has been missing or rejected for too long, so that the filter resets to it."""
        return now_us - self._fused_us > self._after_us
