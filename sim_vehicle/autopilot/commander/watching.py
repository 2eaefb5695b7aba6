"""What the commander keeps an eye on: the ground station, where the vehicle is, and whose sticks count.

Sources: PX4's Commander::dataLinkCheck and MavlinkReceiver::CheckHeartbeats; EKF2 (EKF2_NOAID_TOUT); manual_control
(ManualControlSelector.cpp, ManualControl.cpp, MovingDiff.hpp), for sticks that come over links: this vehicle has no
radio.
"""

from sim_vehicle.autopilot.messages import Severity, StatusText, StickInput
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


# The filter of MovingDiff.
_DIFFERENCE_TIME_CONSTANT_S = 0.1
# How often PX4 looks for sticks that no longer arrive, counted from the last that did.
_LOOK_US = 200_000
# COM_RC_IN_MODE: a radio alone, or nobody.
_NO_LINKS = (0, 4)


class ManualInput:
    """The chosen sticks: those of the first link, until they no longer arrive. Call `update` at every step."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.sticks: StickInput | None = None
        """None while no input that counts arrives."""
        self.moving = False
        self._heard_us = 0
        self._speed = [0.0] * 4

    def heard(self, sticks: StickInput, now_us: int) -> None:
        """MANUAL_CONTROL."""
        before = self.sticks
        if not self._links_count or (before is not None and before.source != sticks.source):
            return
        if before is not None:
            self._measure(before, sticks, 1e-6 * (now_us - self._heard_us))
        self.sticks, self._heard_us = sticks, now_us

    def update(self, now_us: int) -> None:
        """Judge whether the sticks still arrive."""
        looked_us = now_us - (now_us - self._heard_us) % _LOOK_US
        if looked_us - self._heard_us >= 1e6 * self._parameters["COM_RC_LOSS_T"] or not self._links_count:
            self.sticks, self.moving = None, False
            self._speed = [0.0] * 4

    def _measure(self, before: StickInput, now: StickInput, step_s: float) -> None:
        """COM_RC_STICK_OV: how fast, in percent of the way a second, a stick moves when the pilot means it."""
        if step_s <= 0.0:
            return
        share = step_s / (step_s + _DIFFERENCE_TIME_CONSTANT_S)
        # Roll, pitch, throttle and yaw.
        moves = (new - old for new, old in zip(now[:4], before[:4], strict=True))
        self._speed = [speed + share * (move / step_s - speed) for speed, move in zip(self._speed, moves, strict=True)]
        self.moving = max(map(abs, self._speed)) > 0.01 * self._parameters["COM_RC_STICK_OV"]

    @property
    def _links_count(self) -> bool:
        return self._parameters["COM_RC_IN_MODE"] not in _NO_LINKS
