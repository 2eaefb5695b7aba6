"""The interface of all recovery laws: what is known of the contact in, a place to rest and the way there out."""

from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

from pydantic import Field

from companion.messages import Vector3
from companion.recovery.way import REST, Way
from companion.written import NotNegative, Positive, Written


class RecoveryConfig(Written):
    """The mission's `recovery:` part; `gamma` in seconds, one number or one for each horizontal axis."""

    law: str = "adaptive"
    """adaptive, normal or paper."""
    gamma: Positive | tuple[Positive, Positive] = 0.5
    """Laws `paper` and `normal`. The paper's flights have 0.5 s."""
    tangential: Literal["damped", "kept"] = "damped"
    """Laws `normal` and `adaptive`: what becomes of the motion along the obstacle."""
    clearance_m: Positive = 0.35
    """Law `adaptive`, but for the vertical acceleration, which `normal` has too. The guards stay 0.3 m clear; the
    wavering of a hover on optical flow takes 5 cm."""
    clearance_s: NotNegative = 0.31
    """More where the hit was harder: half of eq. 3's distance with the paper's gamma, 0.25 s, and what a vehicle still
    trimmed against the drag of its approach stops short by, up to 0.06 s times v_c in simulation."""
    acceleration_m_s2: Annotated[Positive, Field(le=9.81)] = 3.0
    """PX4's MPC_ACC_HOR: a tilt of 17 degrees, which leaves a vehicle that hovers at 78 % of its thrust its height."""
    vertical_acceleration_m_s2: Annotated[NotNegative, Field(le=9.81)] = 3.0
    """Besides the vehicle's own loop, against climbing or falling after a hit. Hovering at 78 % of the thrust leaves
    2.8 m/s^2 upwards. 0: none."""
    restitution: Annotated[NotNegative, Field(le=1.0)] = 0.2
    """Of the speed into the obstacle, until the rebound has been measured: spring arms, 0.15 to 0.3 in simulation."""

    @property
    def gamma_per_axis(self) -> tuple[float, float]:
        return self.gamma if isinstance(self.gamma, tuple) else (self.gamma, self.gamma)


@dataclass(frozen=True, slots=True)
class Contact:
    """The vehicle at the time of contact t_c: x(t_c), v_c, and the obstacle's outward normal; NED, SI.

    The normal is horizontal, or the obstacle's own where that is steep (see direction.away_from); zero: not known.
    """

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    normal_ned: Vector3


@dataclass(frozen=True, slots=True)
class Moving:
    """Where the vehicle is and how it moves, local NED; the acceleration where nothing but its own thrust makes it."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3 = REST


class RecoveryLaw(Protocol):
    """Pure: the same contact and motion give the same goal and the same way."""

    name: str
    is_refined: bool  # whether goal and way are found anew once the motion after the contact is known
    holds_height: bool  # whether a climb or a fall after the hit is braked by an acceleration of its own

    def expected(self, contact: Contact) -> Moving:
        """The motion after the contact as far as it can be known before it has been measured."""
        ...

    def goal_ned_m(self, contact: Contact, motion: Moving) -> Vector3:
        """Where to come to rest, if there is nothing else around."""
        ...

    def way(self, motion: Moving, goal_ned_m: Vector3) -> Way:
        """How to get there; the goal may have been moved by what is around."""
        ...
