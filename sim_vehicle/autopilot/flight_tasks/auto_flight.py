"""How a target is flown: PX4's FlightTaskAuto with its parameters."""

import math

from sim_vehicle.autopilot.flight_tasks.smoothing import Smoother, towards
from sim_vehicle.autopilot.flight_tasks.target import Kind, NavigatorTarget, View
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3


class AutoFlight:
    """Targets in, setpoints out; local NED."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._smoother = Smoother(parameters)
        self._asked_yaw_rad = 0.0
        self.cruise_m_s: float | None = None
        """As DO_CHANGE_SPEED asked for; None for MPC_XY_CRUISE."""

    def start(self, view: View, at_rest: bool = False) -> None:
        """Begin where the vehicle is."""
        self._smoother.start(view.position_ned_m, (0.0, 0.0, 0.0) if at_rest else view.velocity_ned_m_s)
        self._smoother.yaw_rad = self._asked_yaw_rad = view.yaw_rad

    def demand(self, target: NavigatorTarget, view: View, step_s: float) -> TrajectorySetpoint | None:
        """The next setpoint; None lets the motors idle."""
        if target.kind is Kind.IDLE:
            return None
        self._turn(target, view, step_s)
        if target.kind is Kind.TAKEOFF:
            return self._climb(target, view, step_s)
        if target.kind is Kind.LAND:
            return self.descend(target.position_ned_m, view, land_speed_m_s(view.height_m, self._parameters), step_s)
        self._smoother.advance(target.position_ned_m, step_s, self._cruise_m_s(target))
        return self._smoother.setpoint

    def _cruise_m_s(self, target: NavigatorTarget) -> float:
        wanted = target.speed_m_s or self.cruise_m_s or self._parameters["MPC_XY_CRUISE"]
        return min(wanted, self._parameters["MPC_XY_VEL_MAX"])

    def _climb(self, target: NavigatorTarget, view: View, step_s: float) -> TrajectorySetpoint:
        """Climb at the takeoff's speed; the height follows the vehicle, so that only the speed counts."""
        north, east, down = target.position_ned_m
        height, parameters = view.position_ned_m[2], self._parameters
        *_, v_down = self._smoother.velocity_ned_m_s
        most_m_s = parameters["MPC_TKO_SPEED"]
        # Without a ramp the speed is there at once, as fast as the acceleration allows.
        most_m_s2 = most_m_s / max(parameters["MPC_TKO_RAMP_T"], most_m_s / parameters["MPC_ACC_UP_MAX"])
        wanted = max(self._smoother.vertical_velocity(v_down, down - height, step_s), -most_m_s)
        v_down = towards(v_down, wanted, most_m_s2 * step_s)
        self._smoother.start((north, east, height), (0.0, 0.0, v_down))
        return TrajectorySetpoint((north, east, None), (0.0, 0.0, v_down), yaw_rad=self._smoother.yaw_rad)

    def descend(self, place_ned_m: Vector3, view: View, speed_m_s: float, step_s: float) -> TrajectorySetpoint:
        """Sink at that speed over a place."""
        smoother = self._smoother
        *_, v_down = smoother.velocity_ned_m_s
        v_down = towards(v_down, speed_m_s, self._parameters["MPC_ACC_DOWN_MAX"] * step_s)
        smoother.advance(place_ned_m, step_s, self._parameters["MPC_XY_CRUISE"])
        north, east, _ = smoother.position_ned_m
        v_north, v_east, _ = smoother.velocity_ned_m_s
        smoother.start((north, east, view.position_ned_m[2]), (v_north, v_east, v_down))
        return TrajectorySetpoint((north, east, None), (v_north, v_east, v_down), yaw_rad=smoother.yaw_rad)

    def _turn(self, target: NavigatorTarget, view: View, step_s: float) -> None:
        """As the target says, else towards its place; within NAV_ACC_RAD of that the nose stays as it is."""
        if target.yaw_rad is not None:
            self._asked_yaw_rad = target.yaw_rad
        elif target.kind in (Kind.POSITION, Kind.HOLD):
            north, east, _ = view.position_ned_m
            to_north, to_east = target.position_ned_m[0] - north, target.position_ned_m[1] - east
            if math.hypot(to_north, to_east) > self._parameters["NAV_ACC_RAD"]:
                self._asked_yaw_rad = math.atan2(to_east, to_north)
        self._smoother.turn(self._asked_yaw_rad, step_s)


def land_speed_m_s(height_m: float, parameters: Parameters) -> float:
    """Descent of a landing, slower near the ground."""
    slow_below_m, fast_above_m = parameters["MPC_LAND_ALT2"], parameters["MPC_LAND_ALT1"]
    slow_m_s, fast_m_s = parameters["MPC_LAND_SPEED"], parameters["MPC_Z_VEL_MAX_DN"]
    share = (height_m - slow_below_m) / max(fast_above_m - slow_below_m, 1e-6)
    return slow_m_s + min(max(share, 0.0), 1.0) * (fast_m_s - slow_m_s)
