"""The ways to the ground: every landing of a drawn vehicle, and falls at any tilt, on soft and hard ground."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.cases.vehicles import BenchVehicle
from bench.fly.by_hand.watched import GuardedFlight, Sticks, guard_in_any_mode
from companion.companion import Companion
from companion.mission.model import Mission
from companion.motion.config import GRAVITY_M_S2
from sim_vehicle.airframe import Airframe, Bounce
from sim_vehicle.autopilot.flight_tasks.manual import EXPO
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

BY_STICKS = ("POSCTL", "ALTCTL", "STABILIZED")
# "mission": a companion's own, from the ground to the ground. By sticks as often as by all the others together.
LANDINGS = ("AUTO.LAND", "POSCTL", "AUTO.RTL", "ALTCTL", "mission", "STABILIZED")
# What stops: all motors; one, and soon the others; one alone, under which the vehicle spirals down.
FALLS = ("all motors", "one, then all", "one motor")
# One foot on the ground. Grass and foam give way by centimetres; pulses on concrete last 3 to 7 ms for a stiff frame
# (thecognifly/CrashLandingExperiments), longer on legs.
GROUNDS = {"soft": ((0.03, 0.08), (0.05, 0.2)), "hard": ((0.005, 0.015), (0.2, 0.5))}
STICKS_M_S, LAND_M_S = (0.2, 2.0), (0.6, 2.0)  # MPC_LAND_SPEED is 0.6 at least
LANDS_FROM_M, FALLS_FROM_M, MISSION_M, UP_M = (2.0, 3.5), (1.0, 3.0), 1.5, 0.5
# By barometer or satellites, in half of the flights.
HEIGHT_ERROR_M = (-0.7, 0.7)
DRIFT_M_S, RTL_AWAY_M = (0.0, 0.4), 1.5
# The threshold is known 1 s after the streams are, which takes half a second of counting. PX4 gives sticks all of the
# throttle 3 s after arming.
WINDOW_S, BEGINS_S, STICKS_FROM_S = 0.5, 3.5, 3.1
SPUN_FOR_S = (0.02, 0.15)
# Of a pilot who feels the touch; then until PX4 has disarmed, or a fallen vehicle lies still.
REACTION_S, LOOKED_AFTER_S, LONGEST_S = (0.1, 0.6), 3.0, 45.0
SINK_P_PER_S, DRIFT_P_S_M = 3.0, 0.3


@dataclass(frozen=True, slots=True)
class GroundCase:
    """One way to the ground; everything that is not here is drawn from the seed."""

    seed: int
    imu_hz: int
    way: str
    ground: str

    @property
    def is_fall(self) -> bool:
        return self.way in FALLS


def on_ground(ground: str, airframe: Airframe, rng: np.random.Generator) -> Airframe:
    """The vehicle with feet that meet this ground, fast enough on its way down."""
    contact_s, restitution = GROUNDS[ground]
    foot = Bounce(contact_time_s=float(rng.uniform(*contact_s)), restitution=float(rng.uniform(*restitution)))
    control = {"descent_max_m_s": STICKS_M_S[1] + 0.5}
    return airframe.model_copy(
        update={
            "surface": airframe.surface.model_copy(update={"foot": foot}),
            "control": airframe.control.model_copy(update=control),
        }
    )


def begun(
    case: GroundCase, built: BenchVehicle, airframe: Airframe, sink_m_s: float, rng: np.random.Generator
) -> tuple[GuardedFlight, float]:
    """In HOLD at a height, or on the ground before a mission; and how much too high it takes itself to be."""
    parameters = {"MPC_LAND_SPEED": sink_m_s, "MAN_DEADZONE": 0.0}
    parameters |= {"RTL_RETURN_ALT": 2.0, "RTL_DESCEND_ALT": 1.5, "MPC_LAND_ALT2": 10.0, "MPC_LAND_ALT1": 11.0}
    error_m = float(rng.uniform(*HEIGHT_ERROR_M)) if rng.random() < 0.5 and case.way != "mission" else 0.0
    faults: list[dict[str, Any]] = []
    if error_m != 0.0:
        faults.append({"kind": "estimator_reset", "at_s": 0.0, "position_jump_ned_m": [0.0, 0.0, -error_m]})
    if case.is_fall:
        faults += falling(case.way, BEGINS_S + float(rng.uniform(0.0, 0.5)), rng)
    scene = Scene.model_validate({"faults": faults})
    vehicle = SimulatedVehicle(airframe, scene, case.seed, keeps_path=False, parameters=parameters)
    settings = {**built.settings, "streams": {"highres_imu_hz": float(case.imu_hz), "window_s": WINDOW_S}}
    if case.way == "mission":
        data = {"name": "landing", "items": [{"takeoff": {"height_m": MISSION_M}}, {"land": {}}], "companion": settings}
        companion = Companion(Mission.model_validate(data))
        companion.confirm_plan()
        return GuardedFlight(vehicle, companion), error_m
    low_m, high_m = FALLS_FROM_M if case.is_fall else LANDS_FROM_M
    # The vehicle corrects what it takes for an error of its height before it falls.
    height_m = float(rng.uniform(low_m + max(error_m, 0.0), high_m + min(error_m, 0.0)))
    away_m, side_rad = RTL_AWAY_M * (case.way == "AUTO.RTL"), rng.uniform(-math.pi, math.pi)
    place = (away_m * math.cos(side_rad), away_m * math.sin(side_rad), -height_m)
    vehicle.begin_in_flight(place, (0.0, 0.0, 0.0))
    return GuardedFlight(vehicle, guard_in_any_mode(settings)), error_m


def falling(way: str, at_s: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    lost = {"kind": "motor_failure", "motor": int(rng.integers(4)), "at_s": at_s}
    if way == "one motor":
        return [lost]
    if way == "one, then all":
        return [lost, {"kind": "free_fall", "at_s": at_s + float(rng.uniform(*SPUN_FOR_S))}]
    return [{"kind": "free_fall", "at_s": at_s}]


def to_the_end(flight: GuardedFlight, act: Callable[[], None] = lambda: None) -> None:
    """Until a while after the first touch of the ground; the one before take-off is none."""
    end_s = LONGEST_S
    while flight.time_s < end_s and not flight.watchers[0].program.finished:
        act()
        flight.step()
        if flight.height_m > UP_M and not flight.looks_for_ground:
            flight.watch_for_ground()
        if flight.touched_us is not None:
            end_s = 1e-6 * flight.touched_us + LOOKED_AFTER_S


def land(flight: GuardedFlight, way: str, airframe: Airframe, sink_m_s: float, rng: np.random.Generator) -> None:
    """By the mode, or by a pilot who lowers the throttle when the touch is felt."""
    flight.watch_for_ground()
    asked_s = STICKS_FROM_S if way in BY_STICKS else BEGINS_S
    sticks = lowering(flight, airframe, sink_m_s, rng)

    def act() -> None:
        nonlocal asked_s
        if way in BY_STICKS:
            flight.fly_sticks(sticks)
        if flight.time_s > asked_s and flight.touched_us is None and flight.status.vehicle_mode != way:
            flight.station.set_mode(way)
            asked_s = flight.time_s + 0.5

    to_the_end(flight, act)


def lowering(
    flight: GuardedFlight, airframe: Airframe, sink_m_s: float, rng: np.random.Generator
) -> Callable[[], Sticks]:
    """Down at a speed, with some drift that the pilot does not see."""
    reaction_s, drift_m_s = float(rng.uniform(*REACTION_S)), float(rng.uniform(*DRIFT_M_S))
    grid, hover = np.linspace(0.0, 1.0, 101), airframe.hover_fraction
    # PX4's own curve from the stick to the speed.
    down = float(np.interp(sink_m_s / airframe.control.descent_max_m_s, (1.0 - EXPO) * grid + EXPO * grid**3, grid))

    def sticks() -> Sticks:
        if flight.touched_us is not None and flight.time_s > 1e-6 * flight.touched_us + reaction_s:
            return Sticks(throttle=-1.0)
        north_m_s, east_m_s, down_m_s = flight.velocity_ned_m_s
        # It began with its nose to the north.
        leans = (-DRIFT_P_S_M * east_m_s, DRIFT_P_S_M * (drift_m_s - north_m_s))
        is_lowered = flight.time_s > BEGINS_S
        if flight.status.vehicle_mode != "STABILIZED":
            return Sticks(*leans, throttle=-down if is_lowered else 0.0)
        share = SINK_P_PER_S * (down_m_s - sink_m_s * is_lowered) / GRAVITY_M_S2
        # MPC_THR_CURVE has hovering in the middle.
        return Sticks(*leans, throttle=share * hover / (1.0 - hover) if share > 0.0 else share)

    return sticks
