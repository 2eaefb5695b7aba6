"""Whether the vehicle knows where it is: without GPS the estimator goes on for a while, then it gives up.

Source: PX4's EKF2 (EKF2_NOAID_TOUT); a SITL whose GPS was switched off descended 5.1 s later.
"""

from sim_vehicle.parameters.store import Parameters


class Positioning:
    """The receiver as INJECT_FAILURE or a fault leaves it, and what the estimator makes of its silence."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._lost_us: int | None = None
        self.gps_is_off = False
        """INJECT_FAILURE has silenced the receiver."""
        self.gps_is_jammed = False
        """A fault of the simulation has."""
        self.sees_ground = False
        """Optical flow keeps the local position without GPS."""
        self.has_local = self.has_global = True

    @property
    def is_without_gps(self) -> bool:
        return self.gps_is_off or self.gps_is_jammed

    def update(self, now_us: int) -> None:
        """Let time pass."""
        if not self.is_without_gps:
            self._lost_us, self.has_local, self.has_global = None, True, True
            return
        if self._lost_us is None:
            self._lost_us = now_us
        self.has_global = now_us - self._lost_us < self._parameters["EKF2_NOAID_TOUT"]
        self.has_local = self.has_global or self.sees_ground
