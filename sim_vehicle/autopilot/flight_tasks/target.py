"""Where an automatic mode wants to be, how the vehicle sees itself, and when it has arrived."""

import math
from dataclasses import dataclass
from enum import Enum, auto

from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Quaternion, Vector3

_MICROSECONDS = 1e6
# FlightTaskAuto wants to take off where the way to its target climbs faster than this.
_LEAST_CLIMB_M_S = 0.3


class Kind(Enum):
    """PX4's position_setpoint types."""

    IDLE = auto()
    """Nothing: the motors idle."""
    TAKEOFF = auto()
    POSITION = auto()
    HOLD = auto()
    LAND = auto()


@dataclass(frozen=True, slots=True)
class NavigatorTarget:
    """A place to fly to, local NED. A heading of None is left to MPC_YAW_MODE."""

    kind: Kind
    position_ned_m: Vector3
    yaw_rad: float | None = None
    speed_m_s: float | None = None
    """None: what DO_CHANGE_SPEED asked for, or MPC_XY_CRUISE."""


@dataclass(slots=True)
class View:
    """What the navigator knows; the autopilot renews it at every step."""

    now_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    attitude_wxyz: Quaternion
    landed: bool = True
    armed: bool = False
    home_ned_m: Vector3 = (0.0, 0.0, 0.0)
    home_yaw_rad: float = 0.0

    @property
    def yaw_rad(self) -> float:
        return yaw_of(self.attitude_wxyz)

    @property
    def height_m(self) -> float:
        """Above home."""
        return self.home_ned_m[2] - self.position_ned_m[2]

    def distance_m(self, place_ned_m: Vector3) -> float:
        """Horizontal distance."""
        return math.hypot(place_ned_m[0] - self.position_ned_m[0], place_ned_m[1] - self.position_ned_m[1])


@dataclass(frozen=True, slots=True)
class Acceptance:
    """When a place counts as reached (MissionBlock::is_mission_item_reached_or_completed)."""

    horizontal_m: float
    """Infinite where only the height counts."""
    vertical_m: float
    inside_s: float = 0.0
    yaw_rad: float | None = None
    passes_above: bool = False
    """Being higher is being there, as on a takeoff."""


def takeoff_acceptance(target: NavigatorTarget, view: View, parameters: Parameters) -> Acceptance:
    """Only the height counts, and a low one is not reached by standing on the ground."""
    height_m, vertical_m = view.home_ned_m[2] - target.position_ned_m[2], parameters["NAV_MC_ALT_RAD"]
    vertical_m = height_m / 2 if 0.0 < height_m < vertical_m else vertical_m
    return Acceptance(math.inf, vertical_m, passes_above=True)


def climbs_to(target: NavigatorTarget, view: View, parameters: Parameters) -> bool:
    """Whether PX4 leaves the ground for it: not where the way there is next to level.

    Who asks for a takeoff to latitude and longitude 0 sees it: armed, the vehicle stands until it disarms itself
    (PositionSmoothing::_generateVelocitySetpoint; a SITL stood, too).
    """
    away_m, up_m = view.distance_m(target.position_ned_m), view.position_ned_m[2] - target.position_ned_m[2]
    if away_m == 0.0:
        return True
    way_m = math.hypot(away_m, up_m)
    along_m_s, climb_m_s = parameters["MPC_XY_CRUISE"], parameters["MPC_Z_V_AUTO_UP"]
    speed_m_s = min(math.hypot(along_m_s, climb_m_s), along_m_s * way_m / away_m)
    return speed_m_s * up_m / way_m > _LEAST_CLIMB_M_S


class Arrival:
    """Place first, then heading, then the time to stay: each once and for good, until it begins anew."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """A new place."""
        self._there_since_us: int | None = None
        self._is_aligned = False

    def is_reached(self, target: NavigatorTarget, accepts: Acceptance, view: View, parameters: Parameters) -> bool:
        """Whether the vehicle has been where it should be for long enough."""
        if self._there_since_us is None:
            if view.landed or not _is_near(target, accepts, view):
                return False
            self._there_since_us = view.now_us
        self._is_aligned = self._is_aligned or _is_turned(accepts.yaw_rad, view, parameters)
        return self._is_aligned and view.now_us >= self._there_since_us + accepts.inside_s * _MICROSECONDS


def _is_near(target: NavigatorTarget, accepts: Acceptance, view: View) -> bool:
    too_low_m = view.position_ned_m[2] - target.position_ned_m[2]
    is_high_enough = too_low_m < accepts.vertical_m if accepts.passes_above else abs(too_low_m) <= accepts.vertical_m
    return is_high_enough and view.distance_m(target.position_ned_m) <= accepts.horizontal_m


def _is_turned(yaw_rad: float | None, view: View, parameters: Parameters) -> bool:
    if yaw_rad is None:
        return True
    return abs(math.remainder(yaw_rad - view.yaw_rad, 2 * math.pi)) < math.radians(parameters["MIS_YAW_ERR"])
