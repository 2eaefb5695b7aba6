"""FOLLOW_TARGET: keep a distance, an angle and a height to a target that tells where it is.

Source: PX4's FlightTaskAutoFollowTarget.cpp. Simpler: the target's course is that of its velocity, and no orbit is
flown when it turns; the place to be moves at most at FLW_TGT_MAX_VEL instead.
"""

import math

from sim_vehicle.autopilot.flight_tasks.smoothing import Smoother
from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.autopilot.messages import FollowTarget
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters

# A target slower than this has no course: the vehicle keeps the side on which it is.
_HAS_COURSE_M_S = 0.5
# Without a message for this long there is no target (TARGET_TIMEOUT_US).
_TARGET_LOST_US = 2_500_000


class Follow:
    """The moving place behind a target."""

    def __init__(self, parameters: Parameters, origin: Origin) -> None:
        self._parameters = parameters
        self._origin = origin
        self._smoother = Smoother(parameters)
        self._target: FollowTarget | None = None
        self._heard_us = 0
        self._course_rad = 0.0

    def heard(self, target: FollowTarget, now_us: int) -> None:
        """FOLLOW_TARGET."""
        self._target, self._heard_us = target, now_us
        v_north, v_east, _ = target.velocity_ned_m_s
        if math.hypot(v_north, v_east) > _HAS_COURSE_M_S:
            self._course_rad = math.atan2(v_east, v_north)

    def start(self, view: View) -> None:
        """Begin where the vehicle is."""
        self._smoother.start(view.position_ned_m, view.velocity_ned_m_s)
        self._smoother.yaw_rad = view.yaw_rad

    def demand(self, view: View, step_s: float) -> TrajectorySetpoint:
        """The next setpoint; without a target the vehicle stays."""
        smoother, parameters = self._smoother, self._parameters
        place = smoother.position_ned_m
        if self._target is not None and view.now_us - self._heard_us < _TARGET_LOST_US:
            age_s = 1e-6 * (view.now_us - self._heard_us)
            v_north, v_east, _ = self._target.velocity_ned_m_s
            north, east, _ = self._origin.position_of(self._target.place)
            north, east = north + v_north * age_s, east + v_east * age_s
            angle_rad = self._course_rad + math.radians(parameters["FLW_TGT_FA"])
            distance_m = parameters["FLW_TGT_DST"]
            place = (
                north + distance_m * math.cos(angle_rad),
                east + distance_m * math.sin(angle_rad),
                view.home_ned_m[2] - parameters["FLW_TGT_HT"],
            )
            smoother.turn(math.atan2(east - view.position_ned_m[1], north - view.position_ned_m[0]), step_s)
        smoother.advance(place, step_s, parameters["FLW_TGT_MAX_VEL"])
        return smoother.setpoint
