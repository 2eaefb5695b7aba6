"""What each mode asks of the position control by itself: hold, takeoff, return, land, sink.

Sources: PX4's navigator (takeoff.cpp, rtl.cpp, rtl_direct.cpp, land.cpp), FlightTaskAuto.cpp and their parameters.
"""

import math
from enum import Enum, auto

from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.smoothing import (
    Smoother,
    Vector3,
    stop_point,
    towards,
    vertical_velocity,
)
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.setpoint import TrajectorySetpoint

# MPC_TKO_RAMP_T may be 0: PX4 then allows the whole climb at once.
SHORTEST_RAMP_S = 0.01


class ReturnLeg(Enum):
    """Stages of RETURN."""

    CLIMB = auto()
    GO_HOME = auto()
    LAND = auto()


def return_height_m(height_m: float, home_distance_m: float, parameters: Parameters) -> float:
    """Height above home at which RETURN flies, from the present height and distance (rtl.cpp)."""
    most_m, near_m = parameters["RTL_RETURN_ALT"], parameters["NAV_ACC_RAD"]
    if home_distance_m <= near_m:
        wanted = 2.0 * home_distance_m
    else:
        wanted = most_m
        if home_distance_m <= parameters["RTL_MIN_DIST"]:
            wanted = min(wanted, _cone_height_m(home_distance_m, parameters["RTL_CONE_ANG"]))
        wanted = max(wanted, 2.0 * near_m)
    return max(height_m, min(wanted, most_m))


def _cone_height_m(home_distance_m: float, half_angle_deg: float) -> float:
    """Inside the cone over home: as high as it is there; an angle of 0 means no cone, 90 degrees no climb."""
    if half_angle_deg <= 0:
        return math.inf
    return 0.0 if half_angle_deg >= 90 else home_distance_m / math.tan(math.radians(half_angle_deg))


def land_speed_m_s(height_m: float, parameters: Parameters) -> float:
    """Descent of LAND, slower near the ground: from MPC_Z_VEL_MAX_DN above to MPC_LAND_SPEED below."""
    slow, slow_below_m = parameters["MPC_LAND_SPEED"], parameters["MPC_LAND_ALT2"]
    span_m = max(parameters["MPC_LAND_ALT1"] - slow_below_m, 1e-3)
    share = min(max((height_m - slow_below_m) / span_m, 0.0), 1.0)
    return slow + share * (parameters["MPC_Z_VEL_MAX_DN"] - slow)


class ModeTrajectory:
    """The demand of the modes that fly by themselves; local NED."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.home_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self.home_yaw_rad = 0.0
        self._smoother = Smoother(parameters)
        self._target_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._yaw_rad = 0.0
        self._asked_yaw_rad = 0.0
        self._leg = ReturnLeg.CLIMB
        self._position_ned_m: Vector3 = (0.0, 0.0, 0.0)

    def set_home(self, position_ned_m: Vector3, yaw_rad: float) -> None:
        """Where RETURN leads to: the place of arming, and again that of leaving the ground."""
        self.home_ned_m, self.home_yaw_rad = position_ned_m, yaw_rad

    def enter(
        self, mode: Mode, previous: Mode, position_ned_m: Vector3, velocity_ned_m_s: Vector3, yaw_rad: float
    ) -> None:
        """Start ``mode`` where the vehicle is. HOLD after TAKEOFF keeps the takeoff's target."""
        self._position_ned_m = position_ned_m
        continues = previous is Mode.TAKEOFF and mode is Mode.LOITER
        if not continues:
            self._target_ned_m = stop_point(position_ned_m, velocity_ned_m_s, self._parameters)
            self._yaw_rad = self._asked_yaw_rad = yaw_rad
            self._smoother.start(position_ned_m, velocity_ned_m_s)
        if mode is Mode.TAKEOFF:
            north, east, down = position_ned_m
            self._target_ned_m = (north, east, down - self._parameters["MIS_TAKEOFF_ALT"])
            self._smoother.start(position_ned_m, (0.0, 0.0, 0.0))
        elif mode is Mode.RETURN:
            self._begin_return()

    @property
    def target_ned_m(self) -> Vector3:
        """Where the mode wants to be."""
        return self._target_ned_m

    @property
    def is_descending_to_land(self) -> bool:
        """Whether RETURN has come to its last leg."""
        return self._leg is ReturnLeg.LAND

    def takeoff_is_reached(self, position_ned_m: Vector3) -> bool:
        """Whether TAKEOFF is near enough to its height and place to be over."""
        north, east, down = (p - t for p, t in zip(position_ned_m, self._target_ned_m, strict=True))
        near_m = self._parameters["NAV_ACC_RAD"]
        return abs(down) <= self._parameters["NAV_MC_ALT_RAD"] and math.hypot(north, east) <= near_m

    def demand(self, mode: Mode, position_ned_m: Vector3, step_s: float) -> TrajectorySetpoint | None:
        """The next setpoint of ``mode``; None for a mode that flies nothing by itself."""
        self._position_ned_m = position_ned_m
        turn_rad = math.radians(self._parameters["MPC_YAWRAUTO_MAX"]) * step_s
        self._yaw_rad = _turned_towards(self._yaw_rad, self._asked_yaw_rad, turn_rad)
        if mode in (Mode.LOITER, Mode.POSCTL):
            return self._fly_to_target(step_s)
        if mode is Mode.TAKEOFF:
            return self._climb(step_s)
        if mode is Mode.RETURN:
            return self._return(step_s)
        if mode is Mode.LAND:
            return self._descend(land_speed_m_s(self._height_m(), self._parameters), step_s)
        if mode is Mode.OFFBOARD_LOST:
            return self._descend(self._parameters["MPC_LAND_SPEED"], step_s)
        return None

    def _height_m(self) -> float:
        return self.home_ned_m[2] - self._position_ned_m[2]

    def _home_distance_m(self) -> float:
        return math.hypot(self.home_ned_m[0] - self._position_ned_m[0], self.home_ned_m[1] - self._position_ned_m[1])

    def _fly_to_target(self, step_s: float) -> TrajectorySetpoint:
        self._smoother.advance(self._target_ned_m, step_s)
        return TrajectorySetpoint(
            position_ned_m=self._smoother.position_ned_m,
            velocity_ned_m_s=self._smoother.velocity_ned_m_s,
            acceleration_ned_m_s2=self._smoother.acceleration_ned_m_s2,
            yaw_rad=self._yaw_rad,
        )

    def _climb(self, step_s: float) -> TrajectorySetpoint:
        """Climb at the takeoff's speed; the height follows the vehicle, so that only the speed counts."""
        north, east, down = self._target_ned_m
        height = self._position_ned_m[2]
        *_, v_down = self._smoother.velocity_ned_m_s
        parameters = self._parameters
        speed = parameters["MPC_TKO_SPEED"]
        acceleration = speed / max(parameters["MPC_TKO_RAMP_T"], SHORTEST_RAMP_S)
        wanted = max(vertical_velocity(v_down, down - height, step_s, parameters), -speed)
        v_down = towards(v_down, wanted, acceleration * step_s)
        self._smoother.start((north, east, height), (0.0, 0.0, v_down))
        return TrajectorySetpoint((north, east, None), (0.0, 0.0, v_down), yaw_rad=self._yaw_rad)

    def _descend(self, speed_m_s: float, step_s: float) -> TrajectorySetpoint:
        *_, v_down = self._smoother.velocity_ned_m_s
        v_down = towards(v_down, speed_m_s, self._parameters["MPC_ACC_DOWN_MAX"] * step_s)
        self._smoother.advance(self._target_ned_m, step_s)
        north, east, _ = self._smoother.position_ned_m
        v_north, v_east, _ = self._smoother.velocity_ned_m_s
        self._smoother.start((north, east, self._position_ned_m[2]), (v_north, v_east, v_down))
        return TrajectorySetpoint((north, east, None), (v_north, v_east, v_down), yaw_rad=self._yaw_rad)

    def _begin_return(self) -> None:
        self._leg = ReturnLeg.CLIMB
        north, east, _ = self._position_ned_m
        height_m = return_height_m(self._height_m(), self._home_distance_m(), self._parameters)
        self._target_ned_m = (north, east, self.home_ned_m[2] - height_m)

    def _return(self, step_s: float) -> TrajectorySetpoint:
        down = self._target_ned_m[2]
        if self._leg is ReturnLeg.CLIMB and self._is_at_height(down):
            self._leg = ReturnLeg.GO_HOME
            self._target_ned_m = (self.home_ned_m[0], self.home_ned_m[1], down)
            self._look_home()
        if self._leg is ReturnLeg.GO_HOME and self._home_distance_m() <= self._parameters["NAV_ACC_RAD"]:
            self._leg = ReturnLeg.LAND
            self._asked_yaw_rad = self.home_yaw_rad
        if self._leg is ReturnLeg.LAND:
            return self._descend(land_speed_m_s(self._height_m(), self._parameters), step_s)
        return self._fly_to_target(step_s)

    def _is_at_height(self, down_m: float) -> bool:
        return abs(self._position_ned_m[2] - down_m) <= self._parameters["NAV_MC_ALT_RAD"]

    def _look_home(self) -> None:
        if self._home_distance_m() > self._parameters["NAV_ACC_RAD"]:
            self._asked_yaw_rad = math.atan2(
                self.home_ned_m[1] - self._position_ned_m[1], self.home_ned_m[0] - self._position_ned_m[0]
            )


def _turned_towards(yaw_rad: float, target_rad: float, most_rad: float) -> float:
    """``yaw_rad`` turned the short way by at most ``most_rad``."""
    difference = math.remainder(target_rad - yaw_rad, 2 * math.pi)
    return math.remainder(yaw_rad + towards(0.0, difference, most_rad), 2 * math.pi)
