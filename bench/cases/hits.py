"""Hits of vehicles in free air: what is met, how, by whom, drawn from a seed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.cases.vehicles import AIRFRAMES, BenchVehicle, vehicle_of
from sim_vehicle.airframe import Airframe

Floats = npt.NDArray[np.float64]
# What is hit and how; each as often as the others.
APPROACHES = ("wall", "slanted wall", "leaning wall", "ceiling", "pole")
SPEEDS_M_S = (0.5, 5.0)
# Below the speeds that are asked for, to see where it ends.
SLOW_SPEEDS_M_S = (0.3, 0.5)
SLOW_SHARE = 0.06
# Off the ground by more than any fall within a hit; nothing about the ground is wanted here.
HEIGHT_M = 30.0
SLANT_MAX_DEG = 60.0
LEAN_MAX_DEG = 45.0
# Of a flight into a ceiling against the horizontal, and of the ceiling itself against level.
CLIMB_DEG = (30.0, 90.0)
CEILING_TILT_MAX_DEG = 10.0
POLE_RADIUS_M = (0.02, 0.30)
# Beside the middle, as a share of what still touches if a guard points there; where the vehicle slips by between two of
# them, the same pole again, nearer to the middle.
POLE_OFFSET_SHARES = (0.8, 0.4, 0.0)


@dataclass(frozen=True, slots=True)
class HitCase:
    """One hit; everything that is not here is drawn from the seed."""

    seed: int
    airframe: str
    approach: str
    speed_m_s: float
    is_drawn: bool = False
    """Whether the vehicle, too, is drawn from the seed: one of the airframe's kind, with other numbers."""
    imu_hz: int | None = None
    """The rate asked for of HIGHRES_IMU; None: each that there is."""


def draw_case(seed: int, is_drawn: bool) -> HitCase:
    """The case that belongs to a seed: airframes and approaches in turn, speeds at random."""
    rng = np.random.default_rng([seed, 0])
    speed_m_s = float(rng.uniform(*(SLOW_SPEEDS_M_S if rng.random() < SLOW_SHARE else SPEEDS_M_S)))
    approach = APPROACHES[seed // 2 % len(APPROACHES)]
    return HitCase(seed, AIRFRAMES[seed % 2], approach, round(speed_m_s, 3), is_drawn)


def vehicle_of_hit(case: HitCase) -> BenchVehicle:
    return vehicle_of(case.airframe, case.seed if case.is_drawn else None)


def velocity_towards(case: HitCase, airframe: Airframe, rng: np.random.Generator) -> Floats:
    """Level but towards ceilings, whose climb is within the airframe's limit."""
    heading = rng.uniform(-math.pi, math.pi)
    elevation = 0.0
    if case.approach == "ceiling":
        steepest = math.asin(min(1.0, airframe.control.climb_max_m_s / case.speed_m_s))
        elevation = min(math.radians(rng.uniform(*CLIMB_DEG)), steepest)
    level = math.cos(elevation)
    direction = np.array([level * math.cos(heading), level * math.sin(heading), -math.sin(elevation)])
    return case.speed_m_s * direction


def obstacle_before(
    case: HitCase, airframe: Airframe, at_ned_m: Floats, velocity: Floats, rng: np.random.Generator, offset_share: float
) -> Mapping[str, Any]:
    """The scene with the obstacle where the vehicle's centre then is at about `at_ned_m` when it touches."""
    heading = math.atan2(velocity[1], velocity[0])
    reach_m = airframe.geometry.reach_m
    if case.approach == "pole":
        radius_m = float(rng.uniform(*POLE_RADIUS_M))
        offset_m = offset_share * (reach_m + radius_m) * float(rng.uniform(-1.0, 1.0))
        along = np.array([math.cos(heading), math.sin(heading), 0.0])
        across = np.array([-along[1], along[0], 0.0])
        foot = at_ned_m + (reach_m + radius_m) * along + offset_m * across
        foot[2] = 0.0
        return {"poles": [{"point_ned_m": foot.tolist(), "radius_m": radius_m, "height_m": 2.0 * HEIGHT_M}]}
    slant, lean = 0.0, 0.0
    if case.approach == "slanted wall":
        slant = math.radians(rng.uniform(-SLANT_MAX_DEG, SLANT_MAX_DEG))
    elif case.approach == "leaning wall":
        slant, lean = math.radians(rng.uniform(-30.0, 30.0)), math.radians(rng.uniform(-LEAN_MAX_DEG, LEAN_MAX_DEG))
    elif case.approach == "ceiling":
        slant = rng.uniform(-math.pi, math.pi)
        lean = math.radians(90.0 - rng.uniform(0.0, CEILING_TILT_MAX_DEG))
    facing = heading + math.pi + slant
    normal = np.array([math.cos(lean) * math.cos(facing), math.cos(lean) * math.sin(facing), math.sin(lean)])
    # How far the vehicle sticks out towards the obstacle: guards all round, little up and down.
    sideways, upward = math.hypot(normal[0], normal[1]), abs(normal[2])
    extent_m = math.hypot(reach_m * sideways, airframe.geometry.guard_height_m * upward)
    point = at_ned_m - extent_m * normal
    return {"walls": [{"point_ned_m": point.tolist(), "normal_ned": normal.tolist(), "width_m": 60, "height_m": 40}]}
