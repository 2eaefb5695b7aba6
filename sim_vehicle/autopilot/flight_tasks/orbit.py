"""ORBIT: round a point at a radius and a speed, the nose to the centre.

Source: PX4's FlightTaskOrbit.cpp (its sticks and its other headings left out).
"""

import math

from sim_vehicle.autopilot.flight_tasks.smoothing import Smoother, towards
from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Axis3, Vector3

RADIUS_MIN_M = 1.0
ACCELERATION_MAX_M_S2 = 2.0
# On the circle within this of its radius; PX4's _horizontal_acceptance_radius.
_ON_CIRCLE_M = 2.0


class Orbit:
    """A circle that can be changed while it is flown."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._smoother = Smoother(parameters)
        self._centre_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._radius_m = RADIUS_MIN_M
        self._speed_m_s = 1.0
        """Positive: clockwise."""
        self._slewed_m_s = 0.0
        self._approaches = True

    def start(self, view: View) -> None:
        """Begin round the place where the vehicle is."""
        self._centre_ned_m = view.position_ned_m
        self._radius_m, self._speed_m_s = RADIUS_MIN_M, 1.0
        self._smoother.yaw_rad = view.yaw_rad
        self._approach(view)

    def change(self, view: View, radius_m: float | None, speed_m_s: float | None, centre_ned_m: Axis3) -> bool:
        """Take what a DO_ORBIT says; None leaves as it is. False where the radius is beyond MC_ORBIT_RAD_MAX."""
        clockwise = self._speed_m_s > 0.0 if radius_m is None else radius_m > 0.0
        radius = self._radius_m if radius_m is None else abs(radius_m)
        speed = abs(self._speed_m_s) if speed_m_s is None else speed_m_s
        if not RADIUS_MIN_M <= radius <= self._parameters["MC_ORBIT_RAD_MAX"]:
            return False
        most_m_s = min(self._parameters["MPC_XY_VEL_MAX"], math.sqrt(ACCELERATION_MAX_M_S2 * radius))
        self._radius_m = radius
        self._speed_m_s = math.copysign(min(abs(speed), most_m_s), speed if clockwise else -speed)
        north, east, down = (
            old if new is None else new for old, new in zip(self._centre_ned_m, centre_ned_m, strict=True)
        )
        self._centre_ned_m = (north, east, down)
        if not self._is_on_circle(view):
            self._approach(view)
        return True

    def demand(self, view: View, step_s: float) -> TrajectorySetpoint:
        """The next setpoint: straight to the circle, then along it."""
        if self._approaches and self._is_on_circle(view):
            self._approaches, self._slewed_m_s = False, 0.0
        return self._to_circle(view, step_s) if self._approaches else self._round(view, step_s)

    def _approach(self, view: View) -> None:
        self._approaches = True
        self._smoother.start(view.position_ned_m, view.velocity_ned_m_s)

    def _is_on_circle(self, view: View) -> bool:
        away_m = abs(view.distance_m(self._centre_ned_m) - self._radius_m)
        height_m = abs(view.position_ned_m[2] - self._centre_ned_m[2])
        return away_m < _ON_CIRCLE_M and height_m < self._parameters["NAV_MC_ALT_RAD"]

    def _to_circle(self, view: View, step_s: float) -> TrajectorySetpoint:
        out_north, out_east = self._outward(view)
        north, east, down = self._centre_ned_m
        place = (north + self._radius_m * out_north, east + self._radius_m * out_east, down)
        self._smoother.advance(place, step_s, self._parameters["MPC_XY_CRUISE"])
        self._smoother.turn(math.atan2(-out_east, -out_north), step_s)
        return self._smoother.setpoint

    def _round(self, view: View, step_s: float) -> TrajectorySetpoint:
        out_north, out_east = self._outward(view)
        self._slewed_m_s = towards(self._slewed_m_s, self._speed_m_s, self._parameters["MPC_ACC_HOR"] * step_s)
        speed, outside_m = self._slewed_m_s, self._radius_m - view.distance_m(self._centre_ned_m)
        v_north, v_east = -out_east * speed + outside_m * out_north, out_north * speed + outside_m * out_east
        inward_m_s2 = speed * speed / self._radius_m
        self._smoother.turn(math.atan2(-out_east, -out_north), step_s)
        return TrajectorySetpoint(
            (None, None, self._centre_ned_m[2]),
            (v_north, v_east, 0.0),
            (-out_north * inward_m_s2, -out_east * inward_m_s2, None),
            self._smoother.yaw_rad,
            speed / self._radius_m,
        )

    def _outward(self, view: View) -> tuple[float, float]:
        north, east = view.position_ned_m[0] - self._centre_ned_m[0], view.position_ned_m[1] - self._centre_ned_m[1]
        length = math.hypot(north, east)
        return (north / length, east / length) if length > 0.0 else (1.0, 0.0)
