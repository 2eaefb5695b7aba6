"""Simulated hits: a cruising vehicle, an obstacle in its way, and what every detector makes of what it hears."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.detectors.recording import VehicleRecording
from bench.detectors.scoring import score_hit
from bench.detectors.vehicles import AIRFRAMES, BenchVehicle, vehicle_of
from bench.detectors.watching import detector_names
from companion.messages import LandedState
from companion.reflex.detector import Situation
from sim_vehicle.airframe import Airframe
from sim_vehicle.cruise import Cruise
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# What is hit and how; each as often as the others.
APPROACHES = ("wall", "slanted wall", "leaning wall", "ceiling", "pole")
SPEEDS_M_S = (0.5, 5.0)
# Below the speeds that are asked for, to see where it ends.
SLOW_SPEEDS_M_S = (0.3, 0.5)
SLOW_SHARE = 0.06
# Of an obstacle that comes towards a hovering vehicle: a person who walks, a door that swings.
STRUCK_SPEEDS_M_S = (0.5, 3.0)

# Off the ground by more than any fall within a hit; nothing about the ground is wanted here.
HEIGHT_M = 30.0
# The detector learns the vehicle: its shaking in 0.5 s, how its velocity keeps to its accelerometer in 20 velocities at
# 30 Hz; the velocity filter looks back 0.5 s.
FREE_FLIGHT_S = (1.5, 1.9)
SWITCHED_ON_AFTER_S = 0.5
# Touches later than planned: a slow vehicle whose last centimetres were not in the plan.
PATIENCE_S = 3.0
# From the first touch on: the longest contact is 0.12 s, its aftermath is in the velocity after 0.1 s more.
FOLLOWED_S = 0.45

SLANT_MAX_DEG = 60.0
LEAN_MAX_DEG = 45.0
# Of a flight into a ceiling against the horizontal, and of the ceiling itself against level.
CLIMB_DEG = (30.0, 90.0)
CEILING_TILT_MAX_DEG = 10.0
POLE_RADIUS_M = (0.02, 0.30)
# Beside the middle, as a share of what still touches if a guard points there; where the vehicle slips by between two of
# them, the same pole again, nearer to the middle.
POLE_OFFSET_SHARES = (0.8, 0.4, 0.0)


class NoTouch(Exception):  # noqa: N818 - reads as the sentence it is
    """The vehicle went past the obstacle: the case is at fault, not a detector."""


@dataclass(frozen=True, slots=True)
class HitCase:
    """One hit; everything that is not here is drawn from the seed. `family` says what is varied."""

    family: str
    seed: int
    airframe: str
    approach: str
    speed_m_s: float
    detectors: tuple[str, ...]
    vibration_m_s2: float | None = None
    """Standard deviation of an IMU sample on each axis; None: the airframe's own."""
    velocity_noise_m_s: float | None = None
    """RMS on each axis of the vehicle's velocity estimate; None: the airframe's own."""
    sweeps: bool = False
    """Whether the detectors' thresholds are swept, too."""
    is_struck: bool = False
    """The vehicle hovers, and the obstacle comes at it with the speed."""
    link: str | None = None
    """By name, of what the link to the companion does to packets; None: nothing."""
    is_drawn: bool = False
    """Whether the vehicle, too, is drawn from the seed: one of the airframe's kind, with other numbers."""


def draw_case(family: str, seed: int, detectors: tuple[str, ...] | None = None, **settings: Any) -> HitCase:
    """The case that belongs to a seed: airframes and approaches in turn, speeds at random."""
    rng = np.random.default_rng([seed, 0])
    speeds = SLOW_SPEEDS_M_S if rng.random() < SLOW_SHARE else SPEEDS_M_S
    if settings.get("is_struck"):
        speeds = STRUCK_SPEEDS_M_S
    return HitCase(
        family=family,
        seed=seed,
        airframe=AIRFRAMES[seed % 2],
        approach=APPROACHES[seed // 2 % len(APPROACHES)],
        speed_m_s=round(float(rng.uniform(*speeds)), 3),
        detectors=detector_names() if detectors is None else detectors,
        **settings,
    )


def work_out_hit(case: HitCase) -> dict[str, Any]:
    """Fly it once, then let every detector hear it at every rate."""
    vehicle = vehicle_of_hit(case)
    recording, hit = hit_of(case, vehicle.airframe)
    return score_hit(recording, hit, vehicle, case.seed, case.detectors, case.sweeps, case.link)


def vehicle_of_hit(case: HitCase) -> BenchVehicle:
    vehicle = vehicle_of(case.airframe, case.seed if case.is_drawn else None)
    airframe = vehicle.airframe
    if case.vibration_m_s2 is not None:
        imu = airframe.imu.model_copy(update={"accelerometer_noise_m_s2": case.vibration_m_s2})
        airframe = airframe.model_copy(update={"imu": imu})
    if case.velocity_noise_m_s is not None:
        estimate = airframe.estimate.model_copy(update={"velocity_noise_m_s": case.velocity_noise_m_s})
        airframe = airframe.model_copy(update={"estimate": estimate})
    return BenchVehicle(airframe, vehicle.settings)


def hit_of(case: HitCase, airframe: Airframe) -> tuple[VehicleRecording, Hit]:
    """The case's flight; one past a pole is flown again nearer to its middle. Raises NoTouch."""
    for share in POLE_OFFSET_SHARES[:-1]:
        try:
            return fly_hit(case, airframe, share)
        except NoTouch:
            if case.approach != "pole":
                raise
    return fly_hit(case, airframe, POLE_OFFSET_SHARES[-1])


def fly_hit(
    case: HitCase, airframe: Airframe, offset_share: float = POLE_OFFSET_SHARES[0]
) -> tuple[VehicleRecording, Hit]:
    """Straight on into the obstacle, or hovering until it comes, and on for a moment. Raises NoTouch."""
    rng = np.random.default_rng([case.seed, 1])
    towards = _velocity(case, airframe, rng)
    velocity = 0.0 * towards if case.is_struck else towards
    free_s = float(rng.uniform(*FREE_FLIGHT_S))
    start = np.array([0.0, 0.0, -HEIGHT_M])
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    obstacle = obstacle_before(case, airframe, start + free_s * velocity, towards, rng, offset_share)
    scene = Scene.model_validate(_coming(obstacle, -towards, free_s) if case.is_struck else obstacle)
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
        place = start + steps * interval_s * velocity
        off_reason = "takeoff" if steps * interval_s < SWITCHED_ON_AFTER_S else None
        situation = Situation(
            off_reason=off_reason,
            armed=True,
            landed_state=LandedState.IN_AIR,
            height_m=-output.position_ned_m[2],
            setpoint_position_ned_m=_triple(place),
        )
        recording.add(plant, output, situation, airframe.mass_kg)
        if not touched and hit_row[HIT_ACTIVE] == 1.0:
            touched, left = True, round(FOLLOWED_S / interval_s)
    if not touched:
        raise NoTouch(f"{case.approach} at {case.speed_m_s} m/s was missed")
    if not truth.hits:
        # Still leaning on it: what has happened so far is the hit.
        truth.add_hit(hit_row, scene.world())
    return recording, truth.hits[0]


def _velocity(case: HitCase, airframe: Airframe, rng: np.random.Generator) -> Floats:
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
    case: HitCase,
    airframe: Airframe,
    at_ned_m: Floats,
    velocity: Floats,
    rng: np.random.Generator,
    offset_share: float,
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


def _coming(scene: Mapping[str, Any], velocity: Floats, after_s: float) -> dict[str, Any]:
    """The scene with its obstacle on the way at a velocity, where it was asked to be after so long."""
    motion = {"velocity_ned_m_s": velocity.tolist()}
    return {
        kind: [
            {**one, "point_ned_m": (np.array(one["point_ned_m"]) - after_s * velocity).tolist(), "motion": motion}
            for one in obstacles
        ]
        for kind, obstacles in scene.items()
    }


def _triple(vector: Floats) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
