"""What the commander keeps an eye on: the ground station, and where the vehicle is.

Sources: PX4's Commander::dataLinkCheck and MavlinkReceiver::CheckHeartbeats; EKF2 (EKF2_NOAID_TOUT).
"""

from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.parameters.store import Parameters

# A link calls the ground station present until this long after its last heartbeat: two lost ones and a half.
HEARTBEAT_TIMEOUT_US = 2_500_000


class GroundStation:
    """Heartbeats of every link together."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.lost = True
        self._heard_us: int | None = None
        self._said_lost = False

    def heard(self, now_us: int) -> None:
        """A ground station's heartbeat."""
        self._heard_us = now_us

    def update(self, now_us: int) -> list[StatusText]:
        """Judge, and say what has changed."""
        if self._heard_us is None:
            return []
        silent_us = max(0, now_us - self._heard_us - HEARTBEAT_TIMEOUT_US)
        if not self.lost and silent_us > 1e6 * self._parameters["COM_DL_LOSS_T"]:
            self.lost = self._said_lost = True
            return [StatusText(Severity.INFO, "Connection to ground station lost")]
        if self.lost and silent_us == 0:
            self.lost = False
            return [StatusText(Severity.INFO, "GCS connection regained")] if self._said_lost else []
        return []


class Positioning:
    """The receiver as INJECT_FAILURE or a fault leaves it, and what the estimator makes of its silence.

    Without GPS it goes on for a while, then it gives up: a SITL whose GPS was switched off descended 5.1 s later.
    """

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
