"""Flights of the plant alone: a hit in cruise, for every detector; a hit with motors off."""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bench.cases.hits import (
    HEIGHT_M,
    POLE_OFFSET_SHARES,
    Floats,
    HitCase,
    coming,
    obstacle_before,
    velocity_towards,
)
from bench.fly.wire import VehicleRecording
from companion.messages import LandedState, Vector3
from companion.reflex.detector import Situation
from sim_vehicle.airframe import Airframe
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.plant.cruise import Cruise
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

# The detector learns the vehicle: its shaking in 0.5 s, how its velocity keeps to its accelerometer in 20 velocities at
# 30 Hz; the velocity filter looks back 0.5 s.
FREE_FLIGHT_S = (1.5, 1.9)
SWITCHED_ON_AFTER_S = 0.5
# Touches later than planned: a slow vehicle whose last centimetres were not in the plan.
PATIENCE_S = 3.0
# From the first touch on: the longest contact is 0.12 s, its aftermath is in the velocity after 0.1 s more.
FOLLOWED_S = 0.45
# The wall is far above the ground and met at once, so that the fall counts for nothing.
THROWN_M, GAP_M, AFTER_S = 5.0, 0.02, 0.35


class NoTouch(Exception):  # noqa: N818 - reads as the sentence it is
    """The vehicle went past the obstacle: the case is at fault, not a detector."""


def hit_of(case: HitCase, airframe: Airframe) -> tuple[VehicleRecording, Hit]:
    """The case's flight; one past a pole is flown again nearer to its middle. Raises NoTouch."""
    for share in POLE_OFFSET_SHARES[:-1] if case.approach == "pole" else ():
        with suppress(NoTouch):
            return fly_hit(case, airframe, share)
    return fly_hit(case, airframe, POLE_OFFSET_SHARES[-1])


def fly_hit(
    case: HitCase, airframe: Airframe, offset_share: float = POLE_OFFSET_SHARES[0]
) -> tuple[VehicleRecording, Hit]:
    """Straight on into the obstacle, or hovering until it comes, and on for a moment. Raises NoTouch."""
    rng = np.random.default_rng([case.seed, 1])
    towards = velocity_towards(case, airframe, rng)
    velocity = 0.0 * towards if case.is_struck else towards
    free_s = float(rng.uniform(*FREE_FLIGHT_S))
    start = np.array([0.0, 0.0, -HEIGHT_M])
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    obstacle = obstacle_before(case, airframe, start + free_s * velocity, towards, rng, offset_share)
    scene = Scene.model_validate(coming(obstacle, -towards, free_s) if case.is_struck else obstacle)
    cruise = Cruise(airframe, scene, _triple(start), _triple(velocity), yaw_rad, case.seed)
    recording, interval_s = VehicleRecording(), 1e-6 * airframe.imu.integration_interval_us
    plant, truth, hit_row = cruise.plant, cruise.plant.truth, cruise.plant.state.hit
    left = round((free_s + PATIENCE_S) / interval_s)
    touched = False
    steps = 0
    while left > 0:
        output = cruise.step()
        steps += 1
        left -= 1
        situation = _in_air(output, steps * interval_s, _triple(start + steps * interval_s * velocity))
        recording.add(plant, output, situation, airframe.mass_kg)
        if not touched and hit_row[HIT_ACTIVE] == 1.0:
            touched, left = True, round(FOLLOWED_S / interval_s)
    if not touched:
        raise NoTouch(f"{case.approach} at {case.speed_m_s} m/s was missed")
    if not truth.hits:
        # Still leaning on it: what has happened so far is the hit.
        truth.add_hit(hit_row, scene.world())
    return recording, truth.hits[0]


def _in_air(output: Estimate, flown_s: float, asked_ned_m: Vector3 | None) -> Situation:
    off_reason = "takeoff" if flown_s < SWITCHED_ON_AFTER_S else None
    height_m = -output.position_ned_m[2]
    return Situation(off_reason, True, LandedState.IN_AIR, height_m, setpoint_position_ned_m=asked_ned_m)


def _triple(vector: Floats) -> Vector3:
    return float(vector[0]), float(vector[1]), float(vector[2])


@dataclass(frozen=True, slots=True)
class HeadOnHit:
    """What eq. 2 and the stop of the arms alone make of a hit, without drag and friction."""

    hit: Hit
    time_s: Floats
    """Since the first touch."""
    fold_m: Floats
    """Of the arm that folds the most."""
    speed_m_s: Floats
    """Into the wall."""


def head_on(airframe: Airframe, speed_m_s: float) -> HeadOnHit:
    """Throw the vehicle at a wall and follow it for `AFTER_S`. Without friction, as the falling vehicle would turn."""
    data = airframe.model_dump()
    data["drag_n_s_m"] = 0.0
    data["surface"]["guard_friction"] = 0.0
    wall = {"point_ned_m": [0, 0, -THROWN_M], "normal_ned": [-1, 0, 0]}
    plant = Plant(Airframe.model_validate(data), Scene.model_validate({"walls": [wall]}), seed=1)
    geometry = airframe.geometry
    touch_m = geometry.motor_radius_m / math.sqrt(2.0) + geometry.guard_radius_m
    plant.place((-touch_m - GAP_M, 0.0, -THROWN_M), (speed_m_s, 0.0, 0.0))
    for _ in range(round((GAP_M / speed_m_s + AFTER_S) * 1e6 / plant.interval_us)):
        plant.step(None, armed=False)
    hit, series = plant.truth.hits[0], plant.truth.series()
    time_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    return HeadOnHit(hit, time_s, series["arm_fold_m"].max(axis=1), series["velocity_ned_m_s"][:, 0])
