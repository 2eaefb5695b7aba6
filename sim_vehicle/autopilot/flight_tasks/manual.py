"""How sticks fly: position, altitude and stabilised mode.

Sources: PX4's flight_mode_manager (ManualAcceleration, ManualAltitudeSmoothVel, StickAccelerationXY), lib/stick_yaw and
mc_att_control.
"""

import math

from sim_vehicle.autopilot.flight_tasks.smoothing import slewed, towards
from sim_vehicle.autopilot.flight_tasks.takeoff import GRAVITY_M_S2
from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.autopilot.messages import StickInput
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.control.setpoint import AttitudeSetpoint, Setpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import level_to_north_east
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Axis3

# Sticks::getPositionExpo: MPC_XY_MAN_EXPO and its like were replaced by this figure.
EXPO = 0.6
# Throttle above this is a wish to take off (FlightTaskManualAltitude::_checkTakeoff).
TAKEOFF_STICK = 0.3
# StickAccelerationXY: drag is half of it, so the stick asks for twice the acceleration.
_DRAG_FACTOR = 2.0
_BOOST_TIME_CONSTANT_S = 0.8
_STILL_M_S = 1e-3
# The throttle's upper limit grows from nothing within 2 s of arming (mc_att_control).
_THROTTLE_RISE_PER_S = 0.5

BY_ALTITUDE = (Mode.POSCTL, Mode.ALTCTL)
BY_STICKS = (*BY_ALTITUDE, Mode.STABILIZED)


class ManualFlight:
    """Sticks in, setpoints out."""

    def __init__(self, parameters: Parameters, hover_thrust_fraction: float) -> None:
        self._parameters = parameters
        self._hover_thrust = hover_thrust_fraction
        self._velocity_m_s = (0.0, 0.0)
        self._acceleration_m_s2 = (0.0, 0.0)
        self._place_m: tuple[float, float] | None = None
        self._boost = 1.0
        self._climb_m_s = 0.0
        self._down_m: float | None = None
        self._yaw_rad: float | None = None
        self._armed_s = 0.0

    def start(self, view: View) -> None:
        """Begin where the vehicle is."""
        north, east, down = view.velocity_ned_m_s
        self._velocity_m_s, self._acceleration_m_s2, self._boost = (north, east), (0.0, 0.0), 1.0
        self._climb_m_s, self._place_m, self._down_m, self._yaw_rad = down, None, None, None

    def spin_up(self, armed: bool, step_s: float) -> None:
        """The throttle's upper limit grows once the motors are up to speed, whatever the mode."""
        self._armed_s = self._armed_s + step_s if armed else 0.0

    def demand(self, mode: Mode, sticks: StickInput, view: View, step_s: float) -> Setpoint:
        """The next setpoint of a stick mode."""
        yaw_rate = self._expo(sticks.yaw) * math.radians(self._parameters["MPC_MAN_Y_MAX"])
        yaw_rad = self._locked_yaw(yaw_rate, view)
        if mode not in BY_ALTITUDE:
            return self._stabilised(sticks, yaw_rate, view)
        down, v_down = self._height(sticks, view, step_s)
        if mode is Mode.ALTCTL:
            a_north, a_east = self._tilt(sticks, view)
            acceleration: Axis3 = (a_north, a_east, None)
            return TrajectorySetpoint((None, None, down), (None, None, v_down), acceleration, yaw_rad, yaw_rate)
        self._accelerate(sticks, view, step_s)
        north, east = self._place_m or (None, None)
        return TrajectorySetpoint(
            (north, east, down), (*self._velocity_m_s, v_down), (*self._acceleration_m_s2, None), yaw_rad, yaw_rate
        )

    # --- along the ground --------------------------------------------------------------------------------------

    def _accelerate(self, sticks: StickInput, view: View, step_s: float) -> None:
        """The stick is an acceleration, drag makes of it a speed; a vehicle that stands keeps its place."""
        parameters = self._parameters
        most_m_s, scale = parameters["MPC_VEL_MANUAL"], _DRAG_FACTOR * parameters["MPC_ACC_HOR"]
        forward, right = _within_circle(self._expo(sticks.pitch), self._expo(sticks.roll))
        stick_north, stick_east = level_to_north_east(forward, right, self._heading_rad(view))
        is_free = forward == 0.0 and right == 0.0
        boost = max(2.0, math.sqrt(most_m_s)) if is_free else 1.0
        self._boost += (boost - self._boost) * step_s / (step_s + _BOOST_TIME_CONSTANT_S)
        north, east = self._velocity_m_s
        drag = self._boost * scale / most_m_s
        wanted = (scale * stick_north - drag * north, scale * stick_east - drag * east)
        if is_free and math.hypot(north, east) < max(drag * math.hypot(north, east) * step_s, _STILL_M_S):
            self._velocity_m_s, wanted = (0.0, 0.0), (0.0, 0.0)
        self._acceleration_m_s2 = slewed(self._acceleration_m_s2, wanted, parameters["MPC_JERK_MAX"] * step_s)
        a_north, a_east = self._acceleration_m_s2
        north, east = self._velocity_m_s
        self._velocity_m_s = (north + a_north * step_s, east + a_east * step_s)
        self._keep_place(is_free, view)

    def _keep_place(self, is_free: bool, view: View) -> None:
        moves = math.hypot(*self._velocity_m_s) > _STILL_M_S
        if not is_free:
            self._place_m = None
        elif not moves and self._place_m is None:
            self._place_m, self._velocity_m_s = (view.position_ned_m[0], view.position_ned_m[1]), (0.0, 0.0)
            self._acceleration_m_s2 = (0.0, 0.0)

    def _tilt(self, sticks: StickInput, view: View) -> tuple[float, float]:
        """ALTCTL: the stick leans the vehicle; how it moves is left to the wind."""
        most_m_s2 = GRAVITY_M_S2 * math.tan(math.radians(self._parameters["MPC_MAN_TILT_MAX"]))
        forward, right = _within_circle(sticks.pitch, sticks.roll)
        north, east = level_to_north_east(forward, right, self._heading_rad(view))
        return most_m_s2 * north, most_m_s2 * east

    # --- height and heading ------------------------------------------------------------------------------------

    def _height(self, sticks: StickInput, view: View, step_s: float) -> tuple[float | None, float]:
        parameters = self._parameters
        throttle = self._expo(sticks.throttle)
        most_m_s = parameters["MPC_Z_VEL_MAX_DN"] if throttle < 0.0 else parameters["MPC_Z_VEL_MAX_UP"]
        wanted_m_s = -throttle * most_m_s
        limit = parameters["MPC_ACC_DOWN_MAX"] if wanted_m_s > self._climb_m_s else parameters["MPC_ACC_UP_MAX"]
        self._climb_m_s = towards(self._climb_m_s, wanted_m_s, limit * step_s)
        if throttle != 0.0:
            self._down_m = None
        elif self._down_m is None:
            stands = abs(view.velocity_ned_m_s[2]) < parameters["MPC_HOLD_MAX_Z"]
            if stands and abs(self._climb_m_s) < _STILL_M_S:
                self._down_m = view.position_ned_m[2]
        return self._down_m, self._climb_m_s

    def _locked_yaw(self, yaw_rate_rad_s: float, view: View) -> float | None:
        """While the stick turns there is no heading to keep."""
        if yaw_rate_rad_s != 0.0:
            self._yaw_rad = None
        elif self._yaw_rad is None:
            self._yaw_rad = view.yaw_rad
        return self._yaw_rad

    def _heading_rad(self, view: View) -> float:
        return view.yaw_rad if self._yaw_rad is None else self._yaw_rad

    def _expo(self, stick: float) -> float:
        dead = self._parameters["MAN_DEADZONE"]
        if abs(stick) <= dead:
            return 0.0
        x = math.copysign((abs(stick) - dead) / (1.0 - dead), stick)
        return (1.0 - EXPO) * x + EXPO * x**3

    # --- by attitude -------------------------------------------------------------------------------------------

    def _stabilised(self, sticks: StickInput, yaw_rate: float, view: View) -> AttitudeSetpoint:
        most_rad = math.radians(self._parameters["MPC_MAN_TILT_MAX"])
        roll, pitch = sticks.roll * most_rad, -sticks.pitch * most_rad
        tilt = math.hypot(roll, pitch)
        if tilt > most_rad:
            roll, pitch, tilt = roll * most_rad / tilt, pitch * most_rad / tilt, most_rad
        sin = math.sin(tilt / 2) / tilt if tilt > 0.0 else 0.0
        lean = (math.cos(tilt / 2), roll * sin, pitch * sin)
        half_yaw = self._heading_rad(view) / 2
        c, s = math.cos(half_yaw), math.sin(half_yaw)
        attitude = (c * lean[0], c * lean[1] - s * lean[2], c * lean[2] + s * lean[1], s * lean[0])
        return AttitudeSetpoint(attitude, self._throttle(sticks.throttle, view), yaw_rate)

    def _throttle(self, stick: float, view: View) -> float:
        """Hovering is in the stick's middle (MPC_THR_CURVE 0)."""
        parameters = self._parameters
        rises_s = max(0.0, self._armed_s - parameters["COM_SPOOLUP_TIME"])
        allowed = min(1.0, _THROTTLE_RISE_PER_S * rises_s)
        least = 0.0 if view.landed else parameters["MPC_MANTHR_MIN"]
        most = parameters["MPC_THR_MAX"]
        if stick < 0.0:
            thrust = self._hover_thrust + stick * (self._hover_thrust - least)
        else:
            thrust = self._hover_thrust + stick * (most - self._hover_thrust)
        return min(thrust, allowed)


def _within_circle(x: float, y: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return (x / length, y / length) if length > 1.0 else (x, y)
