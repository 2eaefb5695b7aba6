"""A vehicle that moves as asked, without noise: an integrator over flat ground, and flights that tests begin with."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, DO_SET_MODE
from sim_vehicle.autopilot.flight_commands import NAV_TAKEOFF
from sim_vehicle.autopilot.messages import Command, CommandAck, FlightInput, PositionTarget, Result, StickInput
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem
from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.control.setpoint import FREE, AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Axis3

STEP_US = 4_000
HOVER = 0.5
MAX_ACCELERATION_M_S2 = 6.0

STANDING = Estimate(
    time_boot_us=0,
    specific_force_frd_m_s2=(0.0, 0.0, -9.81),
    angular_velocity_frd_rad_s=(0.0, 0.0, 0.0),
    clipping_counts=(0, 0, 0),
    position_ned_m=(0.0, 0.0, 0.0),
    velocity_ned_m_s=(0.0, 0.0, 0.0),
    acceleration_ned_m_s2=(0.0, 0.0, 0.0),
    attitude_wxyz=(1.0, 0.0, 0.0, 0.0),
    thrust_fraction=0.0,
    motor_fractions=(0.0, 0.0, 0.0, 0.0),
)


def attitude_of_yaw(yaw_rad: float) -> tuple[float, float, float, float]:
    return math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)


def moved(state: Estimate, setpoint: Setpoint | None, armed: bool) -> Estimate:
    step_s = 1e-6 * STEP_US
    if not armed:
        setpoint = None
    if isinstance(setpoint, AttitudeSetpoint | RatesSetpoint):
        w, x, y, z = attitude = setpoint.attitude_wxyz if isinstance(setpoint, AttitudeSetpoint) else (1.0, 0, 0, 0)
        thrust = setpoint.thrust_fraction
        up = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
        accelerations = [9.81 * (axis == 2) - 9.81 * thrust / HOVER * up[axis] for axis in range(3)]
        state = state._replace(attitude_wxyz=attitude)
    elif setpoint is None:
        falls = 9.81 if state.position_ned_m[2] < 0.0 else 0.0
        accelerations = [0.0, 0.0, falls]
        thrust = 0.05 if armed else 0.0
    else:
        accelerations = [_acceleration(state, setpoint, axis) for axis in range(3)]
        thrust = HOVER * (1 - accelerations[2] / 9.81)
    velocity = [v + a * step_s for v, a in zip(state.velocity_ned_m_s, accelerations, strict=True)]
    position = [p + v * step_s for p, v in zip(state.position_ned_m, velocity, strict=True)]
    if position[2] >= 0.0:
        position[2] = 0.0
        velocity = [0.0, 0.0, min(velocity[2], 0.0)]
    yaw = setpoint.yaw_rad if isinstance(setpoint, TrajectorySetpoint) else None
    return state._replace(
        time_boot_us=state.time_boot_us + STEP_US,
        position_ned_m=(position[0], position[1], position[2]),
        velocity_ned_m_s=(velocity[0], velocity[1], velocity[2]),
        thrust_fraction=max(thrust, 0.0),
        attitude_wxyz=state.attitude_wxyz if yaw is None else attitude_of_yaw(yaw),
    )


def _acceleration(state: Estimate, setpoint: TrajectorySetpoint, axis: int) -> float:
    wanted = setpoint.velocity_ned_m_s[axis] or 0.0
    height = setpoint.position_ned_m[axis]
    if height is not None:
        wanted += 2.0 * (height - state.position_ned_m[axis])
    raw = 5.0 * (wanted - state.velocity_ned_m_s[axis])
    return min(max(raw, -MAX_ACCELERATION_M_S2), MAX_ACCELERATION_M_S2)


class Flight:
    """An autopilot on the kinematic vehicle, in virtual time."""

    def __init__(self, **parameters: float) -> None:
        self.state = STANDING
        self.parameters = Parameters(parameters)
        self.autopilot = Autopilot(HOVER, self.state, self.parameters)
        self.acks: list[CommandAck] = []

    @property
    def time_s(self) -> float:
        return 1e-6 * self.state.time_boot_us

    @property
    def height_m(self) -> float:
        return -self.state.position_ned_m[2]

    def step(self) -> None:
        self.acks += self.autopilot.run_commander()
        setpoint = self.autopilot.run_control()
        self.state = moved(self.state, setpoint, self.autopilot.motors_run)
        self.autopilot.observe(self.state)

    def fly(self, seconds: float, message: FlightInput | None = None, rate_hz: float = 20.0) -> None:
        """Let time pass, with ``message`` as a stream if it is given."""
        period = round(250 / rate_hz)
        for number in range(round(seconds * 250)):
            if message is not None and number % period == 0:
                self.autopilot.receive(message)
            self.step()

    def fly_until(self, condition: Callable[[], bool], at_most_s: float, message: FlightInput | None = None) -> float:
        """Seconds until ``condition()`` is true."""
        start_s = self.time_s
        while not condition():
            assert self.time_s - start_s < at_most_s, f"not within {at_most_s} s"
            self.fly(0.004, message)
        return self.time_s - start_s

    def ask(self, command: int, *params: float) -> Result | None:
        """Send a command, parameters that are not given as NaN; its answer, or None."""
        self.acks.clear()
        a, b, c, d, e, f, g = (*params, *[math.nan] * (7 - len(params)))
        self.autopilot.command(Command(255, 190, 1, 1, command, a, b, c, d, e, f, g))
        self.step()
        return self.acks[0].result if self.acks else None

    def texts(self) -> list[str]:
        return [text.text for text in self.autopilot.texts]


def target(position: Axis3 = FREE, velocity: Axis3 = FREE, **others: Any) -> PositionTarget:
    return replace(PositionTarget(1, position, velocity, FREE, None, None, is_force=False), **others)


ORIGIN = Origin()


def hovering(height_m: float = 5.0, **parameters: float) -> Flight:
    """In hold, taken off to that height."""
    flight = Flight(MIS_TAKEOFF_ALT=height_m, **parameters)
    assert flight.ask(NAV_TAKEOFF) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    flight.fly_until(lambda: flight.autopilot.modes.flown is Mode.LOITER, 30.0)
    flight.fly(3.0)
    flight.autopilot.texts.clear()
    return flight


def in_offboard(setpoint: PositionTarget, **parameters: float) -> Flight:
    """The same in OFFBOARD, that setpoint having just been sent."""
    flight = hovering(5.0, **parameters)
    flight.fly(0.2, setpoint)
    assert set_mode(flight, Mode.OFFBOARD) is Result.ACCEPTED
    flight.fly(0.5, setpoint)
    flight.autopilot.receive(setpoint)
    return flight


def north_east(flight: Flight) -> tuple[float, float]:
    north, east, _ = flight.state.position_ned_m
    return north, east


def set_mode(flight: Flight, mode: Mode) -> Result | None:
    custom = NUMBERS[mode].custom_mode
    return flight.ask(DO_SET_MODE, 1, custom >> 16 & 0xFF, custom >> 24)


def place(north_m: float, east_m: float) -> tuple[float, float]:
    there = ORIGIN.place_at((north_m, east_m, 0.0))
    return there.latitude_deg, there.longitude_deg


def item(
    command: int,
    north_m: float = 0.0,
    east_m: float = 0.0,
    up_m: float = 5.0,
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, math.nan),
    autocontinue: int = 1,
) -> StoredItem:
    """An item with a place, its height above home."""
    return StoredItem(kinds.FRAME_GLOBAL_RELATIVE_INT, command, autocontinue, (*params, *place(north_m, east_m), up_m))


def action(command: int, *params: float) -> StoredItem:
    a, b, c, d, e, f, g = (*params, *[0.0] * (7 - len(params)))
    return StoredItem(kinds.FRAME_MISSION, command, 1, (a, b, c, d, e, f, g))


def upload(flight: Flight, *items: StoredItem, kind: MissionType = MissionType.MISSION) -> None:
    flight.autopilot.missions.replace(kind, items)
    flight.fly(0.06)


def sticks(
    flight: Flight, seconds: float, roll: float = 0, pitch: float = 0, throttle: float = 0, yaw: float = 0
) -> None:
    """Hold the sticks, sent at 50 Hz."""
    flight.fly(seconds, StickInput(roll, pitch, throttle, yaw, source=2), rate_hz=50.0)
