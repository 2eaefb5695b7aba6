"""Offboard setpoints: which are valid, when their stream counts as alive, and what they ask for.

Sources: PX4's MavlinkReceiver (its handlers of SET_POSITION_TARGET_LOCAL_NED and SET_ATTITUDE_TARGET), commander's
offboardCheck.cpp and PositionControl::_inputValid; the delays are measured.
"""

import math

from sim_vehicle.autopilot.messages import AttitudeTarget, PositionTarget, Severity, StatusText
from sim_vehicle.control.setpoint import FREE, AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import level_to_north_east, to_ned, yaw_of
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Axis3, Quaternion

FRAME_LOCAL_NED = 1
FRAME_BODY_NED = 8

# With COM_OF_LOSS_T = 1.0 s the mode changes 1.03 to 1.11 s after the last setpoint: the commander's
# own cycle, and a check that runs only now and then. Here: 0.03 s later, looked at every 76 ms.
NOTICED_AFTER_US = 30_000
CHECK_PERIOD_US = 76_000
# OFFBOARD can be chosen from the first setpoint on: it makes the commander check at once. Out of the
# failsafe, setpoints that come back lead 0.09 s after the first of them.
BACK_AFTER_US = 90_000

# The commander publishes its status, and with it which controllers run, twice a second or when something has changed.
STATUS_PERIOD_US = 500_000

STOP = TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, 0.0))


class OffboardSignal:
    """Whether setpoints arrive, judged as late as PX4 judges it."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.arrives = False
        self.is_back = False
        """Whether it has arrived for long enough to end a failsafe."""
        self.needs_place = False
        """The last setpoint was one of position or velocity, which nobody flies without knowing them."""
        self._first_us = 0
        self._last_us: int | None = None
        self._next_check_us = 0

    def heard(self, now_us: int, needs_place: bool) -> None:
        """A valid setpoint was received."""
        self.needs_place = needs_place
        if self._last_us is None:
            self._first_us = now_us
        self._last_us = now_us

    def update(self, now_us: int) -> bool:
        """Judge the stream, at every step; whether the judgement is another."""
        if self._last_us is None:
            return False
        arrived, was_back = self.arrives, self.is_back
        self.arrives = True
        self.is_back = now_us - self._first_us >= BACK_AFTER_US
        if now_us >= self._next_check_us:
            self._next_check_us = now_us + CHECK_PERIOD_US
            if now_us - self._last_us >= 1e6 * self._parameters["COM_OF_LOSS_T"] + NOTICED_AFTER_US:
                self.arrives = self.is_back = False
                self._last_us = None
        return self.arrives is not arrived or self.is_back is not was_back


def refusal(target: PositionTarget) -> StatusText | None:
    """Why PX4 refuses a setpoint, which then counts as none at all; None where it is valid."""
    if target.frame not in (FRAME_LOCAL_NED, FRAME_BODY_NED):
        return _refused(f"coordinate frame {target.frame} unsupported")
    position, velocity, acceleration = _controlled(target)
    if acceleration != FREE and target.is_force:
        return _refused("force not supported")
    if position == FREE and velocity == FREE and acceleration == FREE:
        return _refused("invalid")
    return None


def trajectory_setpoint(target: PositionTarget, attitude_wxyz: Quaternion) -> TrajectorySetpoint:
    """The valid ``target`` in local NED; one that leaves an axis without any demand means stop."""
    position, velocity, acceleration = _controlled(target)
    if target.frame == FRAME_BODY_NED:
        velocity = _turned_by_yaw(velocity, attitude_wxyz)
        acceleration = _turned(acceleration, attitude_wxyz)
    if not _is_complete(position, velocity, acceleration):
        return STOP
    return TrajectorySetpoint(position, velocity, acceleration, target.yaw_rad, target.yaw_rate_rad_s)


def attitude_setpoint(target: AttitudeTarget) -> AttitudeSetpoint | RatesSetpoint | None:
    """What a SET_ATTITUDE_TARGET asks for; None where neither attitude nor roll and pitch rates are given.

    PX4 publishes both where both are given; the attitude control then makes rates of its own, so the attitude counts.
    Without thrust the motors idle, as PX4's setpoint of zero has them.
    """
    thrust = min(max(target.thrust or 0.0, 0.0), 1.0)
    roll, pitch, yaw = target.rates_frd_rad_s
    if target.attitude_wxyz is not None:
        length = math.hypot(*target.attitude_wxyz)
        if not 0.0 < length < math.inf:
            return None
        w, x, y, z = (part / length for part in target.attitude_wxyz)
        return AttitudeSetpoint((w, x, y, z), thrust, yaw or 0.0)
    if roll is None or pitch is None:
        return None
    return RatesSetpoint((roll, pitch, yaw or 0.0), thrust)


def _refused(why: str) -> StatusText:
    return StatusText(Severity.CRITICAL, f"SET_POSITION_TARGET_LOCAL_NED {why}")


def _controlled(target: PositionTarget) -> tuple[Axis3, Axis3, Axis3]:
    """The vectors that count: in the body's frame no position, and only whole vectors."""
    if target.frame == FRAME_LOCAL_NED:
        return target.position_m, target.velocity_m_s, target.acceleration_m_s2
    velocity = FREE if None in target.velocity_m_s else target.velocity_m_s
    acceleration = FREE if None in target.acceleration_m_s2 else target.acceleration_m_s2
    return FREE, velocity, acceleration


def _is_complete(position: Axis3, velocity: Axis3, acceleration: Axis3) -> bool:
    """Every axis needs a demand, and north and east only come together."""
    for vector in (position, velocity, acceleration):
        if (vector[0] is None) != (vector[1] is None):
            return False
    return FREE not in zip(position, velocity, acceleration, strict=True)


def _turned_by_yaw(vector: Axis3, attitude_wxyz: Quaternion) -> Axis3:
    """Forward and right to north and east by the heading alone; down stays down."""
    forward, right, down = vector
    if forward is None or right is None:
        return FREE
    return *level_to_north_east(forward, right, yaw_of(attitude_wxyz)), down


def _turned(vector: Axis3, attitude_wxyz: Quaternion) -> Axis3:
    """Body FRD to NED by the whole attitude."""
    x, y, z = vector
    return FREE if x is None or y is None or z is None else to_ned(attitude_wxyz, (x, y, z))


class OffboardControl:
    """The last valid setpoint that came in OFFBOARD.

    An attitude counts at once. From an attitude to a position PX4 changes when its commander publishes its status
    (Commander.cpp, updateControlMode): until then the last attitude is held.
    """

    def __init__(self, signal: OffboardSignal) -> None:
        self.demand: Setpoint = STOP
        self._waiting: TrajectorySetpoint | None = None
        self._by_attitude = False
        self._signal = signal

    def begin(self, last_demand: Setpoint | None) -> None:
        """The mode was entered: until a setpoint arrives the last demand goes on, or the vehicle stops."""
        self.demand, self._waiting = last_demand or STOP, None
        self._by_attitude = False

    def status_published(self) -> None:
        """The controllers of the last setpoint's kind run from now on."""
        if self._waiting is not None:
            self.demand, self._waiting = self._waiting, None
        self._by_attitude = not isinstance(self.demand, TrajectorySetpoint)

    def take_position(
        self, target: PositionTarget, now_us: int, is_flown: bool, attitude_wxyz: Quaternion
    ) -> StatusText | None:
        """Take a setpoint, valid or not, whatever the mode; why it was refused."""
        refused = refusal(target)
        if refused is not None:
            return refused
        self._signal.heard(now_us, needs_place=(target.position_m, target.velocity_m_s) != (FREE, FREE))
        if is_flown:
            demand = trajectory_setpoint(target, attitude_wxyz)
            if self._by_attitude:
                self._waiting = demand
            else:
                self.demand = demand
        return None

    def take_attitude(self, target: AttitudeTarget, now_us: int, is_flown: bool) -> None:
        """SET_ATTITUDE_TARGET; one without attitude and rates is none at all."""
        demand = attitude_setpoint(target)
        if demand is None:
            return
        self._signal.heard(now_us, needs_place=False)
        if is_flown:
            self.demand, self._waiting = demand, None
