"""Whether a ground station is there. Source: PX4's Commander::dataLinkCheck and MavlinkReceiver::CheckHeartbeats."""

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
