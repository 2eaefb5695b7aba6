"""The interface of all recovery laws: what is known of the contact in, a setpoint out."""

from dataclasses import dataclass
from typing import Protocol

from companion.messages import Vector3
from companion.written import Positive, Written


class RecoveryConfig(Written):
    """The mission's `recovery:` part; gamma in seconds, one number or one for each horizontal axis."""

    law: str = "paper"
    gamma: Positive | tuple[Positive, Positive] = 0.5

    @property
    def gamma_per_axis(self) -> tuple[float, float]:
        return self.gamma if isinstance(self.gamma, tuple) else (self.gamma, self.gamma)


@dataclass(frozen=True, slots=True)
class Contact:
    """The vehicle at the time of contact t_c: x(t_c), v_c, and the obstacle's outward normal; NED, SI."""

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    normal_ned: Vector3


class RecoveryLaw(Protocol):
    """Pure: the same contact gives the same setpoint."""

    name: str

    def setpoint_ned_m(self, contact: Contact) -> Vector3:
        """Where to go after the contact, in the frame of the contact's position."""
        ...
