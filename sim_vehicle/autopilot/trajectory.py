"""What each mode asks of the position control by itself: hold, takeoff, return, land, sink.

Sources: PX4's navigator (takeoff.cpp, rtl.cpp, rtl_direct.cpp, land.cpp), FlightTaskAuto.cpp and their
parameters' defaults; RTL_RETURN_ALT and NAV_ACC_RAD as rc.mc_defaults sets them for multicopters.
"""

import math
from enum import Enum, auto

from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.smoothing import (
    ACCELERATION_DOWN_M_S2,
    Smoother,
    Vector3,
    stop_point,
    towards,
    vertical_velocity,
)
from sim_vehicle.setpoint import TrajectorySetpoint

TAKEOFF_HEIGHT_M = 2.5  # MIS_TAKEOFF_ALT, above where the takeoff began
TAKEOFF_SPEED_M_S = 1.5  # MPC_TKO_SPEED
TAKEOFF_ACCELERATION_M_S2 = TAKEOFF_SPEED_M_S / 3.0  # MPC_TKO_SPEED / MPC_TKO_RAMP_T
HEIGHT_REACHED_M = 0.8  # NAV_MC_ALT_RAD: nearer than this counts as reached
PLACE_REACHED_M = 2.0  # NAV_ACC_RAD

LAND_SPEED_M_S = 0.7  # MPC_LAND_SPEED, below 5 m
LAND_SPEED_HIGH_M_S = 1.5  # MPC_Z_VEL_MAX_DN, above 10 m
LAND_SLOW_BELOW_M, LAND_FAST_ABOVE_M = 5.0, 10.0  # MPC_LAND_ALT2, MPC_LAND_ALT1

RETURN_HEIGHT_M = 30.0  # RTL_RETURN_ALT
RETURN_NEAR_M = 10.0  # RTL_MIN_DIST: nearer than this the return stays inside a cone
RETURN_CONE_RAD = math.radians(45.0)  # RTL_CONE_ANG
YAW_RATE_RAD_S = math.radians(60.0)  # MPC_YAWRAUTO_MAX


class ReturnLeg(Enum):
    """Stages of RETURN."""

    CLIMB = auto()
    GO_HOME = auto()
    LAND = auto()


def return_height_m(height_m: float, home_distance_m: float) -> float:
    """Height above home at which RETURN flies, from the present height and distance (rtl.cpp)."""
    if home_distance_m <= PLACE_REACHED_M:
        wanted = 2.0 * home_distance_m
    else:
        wanted = RETURN_HEIGHT_M
        if home_distance_m <= RETURN_NEAR_M:
            wanted = min(wanted, home_distance_m / math.tan(RETURN_CONE_RAD))
        wanted = max(wanted, 2.0 * PLACE_REACHED_M)
    return max(height_m, min(wanted, RETURN_HEIGHT_M))


def land_speed_m_s(height_m: float) -> float:
    """Descent of LAND, slower near the ground."""
    share = (height_m - LAND_SLOW_BELOW_M) / (LAND_FAST_ABOVE_M - LAND_SLOW_BELOW_M)
    return LAND_SPEED_M_S + min(max(share, 0.0), 1.0) * (LAND_SPEED_HIGH_M_S - LAND_SPEED_M_S)


class ModeTrajectory:
    """The demand of the modes that fly by themselves; local NED."""

    def __init__(self) -> None:
        self.home_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._home_yaw_rad = 0.0
        self._smoother = Smoother()
        self._target_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._yaw_rad = 0.0
        self._asked_yaw_rad = 0.0
        self._leg = ReturnLeg.CLIMB
        self._position_ned_m: Vector3 = (0.0, 0.0, 0.0)

    def set_home(self, position_ned_m: Vector3, yaw_rad: float) -> None:
        """Where RETURN leads to: the place of arming, and again that of leaving the ground."""
        self.home_ned_m, self._home_yaw_rad = position_ned_m, yaw_rad

    def enter(
        self, mode: Mode, previous: Mode, position_ned_m: Vector3, velocity_ned_m_s: Vector3, yaw_rad: float
    ) -> None:
        """Start ``mode`` where the vehicle is. HOLD after TAKEOFF keeps the takeoff's target."""
        self._position_ned_m = position_ned_m
        continues = previous is Mode.TAKEOFF and mode is Mode.LOITER
        if not continues:
            self._target_ned_m = stop_point(position_ned_m, velocity_ned_m_s)
            self._yaw_rad = self._asked_yaw_rad = yaw_rad
            self._smoother.start(position_ned_m, velocity_ned_m_s)
        if mode is Mode.TAKEOFF:
            north, east, down = position_ned_m
            self._target_ned_m = (north, east, down - TAKEOFF_HEIGHT_M)
            self._smoother.start(position_ned_m, (0.0, 0.0, 0.0))
        elif mode is Mode.RETURN:
            self._begin_return()

    @property
    def is_descending_to_land(self) -> bool:
        """Whether RETURN has come to its last leg."""
        return self._leg is ReturnLeg.LAND

    def takeoff_is_reached(self, position_ned_m: Vector3) -> bool:
        """Whether TAKEOFF is near enough to its height and place to be over."""
        north, east, down = (p - t for p, t in zip(position_ned_m, self._target_ned_m, strict=True))
        return abs(down) <= HEIGHT_REACHED_M and math.hypot(north, east) <= PLACE_REACHED_M

    def demand(self, mode: Mode, position_ned_m: Vector3, step_s: float) -> TrajectorySetpoint | None:
        """The next setpoint of ``mode``; None for a mode that flies nothing by itself."""
        self._position_ned_m = position_ned_m
        self._yaw_rad = _turned_towards(self._yaw_rad, self._asked_yaw_rad, YAW_RATE_RAD_S * step_s)
        if mode in (Mode.LOITER, Mode.POSCTL):
            return self._fly_to_target(step_s)
        if mode is Mode.TAKEOFF:
            return self._climb(step_s)
        if mode is Mode.RETURN:
            return self._return(step_s)
        if mode is Mode.LAND:
            return self._descend(land_speed_m_s(self._height_m()), step_s)
        if mode is Mode.OFFBOARD_LOST:
            return self._descend(LAND_SPEED_M_S, step_s)
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
        wanted = max(vertical_velocity(v_down, down - height, step_s), -TAKEOFF_SPEED_M_S)
        v_down = towards(v_down, wanted, TAKEOFF_ACCELERATION_M_S2 * step_s)
        self._smoother.start((north, east, height), (0.0, 0.0, v_down))
        return TrajectorySetpoint((north, east, None), (0.0, 0.0, v_down), yaw_rad=self._yaw_rad)

    def _descend(self, speed_m_s: float, step_s: float) -> TrajectorySetpoint:
        *_, v_down = self._smoother.velocity_ned_m_s
        v_down = towards(v_down, speed_m_s, ACCELERATION_DOWN_M_S2 * step_s)
        self._smoother.advance(self._target_ned_m, step_s)
        north, east, _ = self._smoother.position_ned_m
        v_north, v_east, _ = self._smoother.velocity_ned_m_s
        self._smoother.start((north, east, self._position_ned_m[2]), (v_north, v_east, v_down))
        return TrajectorySetpoint((north, east, None), (v_north, v_east, v_down), yaw_rad=self._yaw_rad)

    def _begin_return(self) -> None:
        self._leg = ReturnLeg.CLIMB
        north, east, _ = self._position_ned_m
        height_m = return_height_m(self._height_m(), self._home_distance_m())
        self._target_ned_m = (north, east, self.home_ned_m[2] - height_m)

    def _return(self, step_s: float) -> TrajectorySetpoint:
        down = self._target_ned_m[2]
        if self._leg is ReturnLeg.CLIMB and abs(self._position_ned_m[2] - down) <= HEIGHT_REACHED_M:
            self._leg = ReturnLeg.GO_HOME
            self._target_ned_m = (self.home_ned_m[0], self.home_ned_m[1], down)
            self._look_home()
        if self._leg is ReturnLeg.GO_HOME and self._home_distance_m() <= PLACE_REACHED_M:
            self._leg = ReturnLeg.LAND
            self._asked_yaw_rad = self._home_yaw_rad
        if self._leg is ReturnLeg.LAND:
            return self._descend(land_speed_m_s(self._height_m()), step_s)
        return self._fly_to_target(step_s)

    def _look_home(self) -> None:
        if self._home_distance_m() > PLACE_REACHED_M:
            self._asked_yaw_rad = math.atan2(
                self.home_ned_m[1] - self._position_ned_m[1], self.home_ned_m[0] - self._position_ned_m[0]
            )


def _turned_towards(yaw_rad: float, target_rad: float, most_rad: float) -> float:
    """``yaw_rad`` turned the short way by at most ``most_rad``."""
    difference = math.remainder(target_rad - yaw_rad, 2 * math.pi)
    return math.remainder(yaw_rad + towards(0.0, difference, most_rad), 2 * math.pi)
