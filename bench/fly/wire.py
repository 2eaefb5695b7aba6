"""Hits as a companion hears them at several rates of the IMU, from one flight; what detectors find of them."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bench.cases.hits import HEIGHT_M, POLE_OFFSET_SHARES, Floats, HitCase, obstacle_before, velocity_towards
from companion.link.streams import wanted_streams
from companion.mavlink.decode import Decoder
from companion.messages import MessageId, Sample
from companion.mission.config import CompanionConfig
from companion.reflex.detection.detector import Situation
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.detection.monitor import advance, start_monitor
from sim_vehicle.airframe import Airframe
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.physics.layout import HIT_ACTIVE, HIT_IMPULSE, HIT_START_US
from sim_vehicle.quantities import Vector3, vector
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# HIGHRES_IMU asked for, by what a client of PX4 receives of it.
ASKED_HZ = {50: 50.0, 100: 100.0, 246: 250.0}


@dataclass(frozen=True, slots=True)
class HeardStep:
    """The samples that arrive at a time, and what the companion knows of its flight then."""

    time_boot_us: int
    samples: tuple[Sample, ...]
    situation: Situation


@dataclass(slots=True)
class HeardHit:
    """A flight into an obstacle."""

    hit: Hit
    heard: dict[int, list[HeardStep]]
    """All that arrives on a link of its own, by the rate received of HIGHRES_IMU."""
    contact_m_s2: dict[int, float]
    """By the time at its end the obstacles' mean force on the vehicle over an interval, per unit mass."""


@dataclass(slots=True)
class _Contact:
    """The impulse of the latest contact, as of the latest interval."""

    started_us: float = 0.0
    impulse_ned_n_s: Vector3 = (0.0, 0.0, 0.0)

    def added_n_s(self, hit: Floats) -> float:
        """Size of the impulse that the obstacles gave in the interval that has just been flown."""
        started_us = float(hit[HIT_START_US])
        if started_us == 0.0:
            return 0.0
        x, y, z = hit[HIT_IMPULSE].tolist()
        before = self.impulse_ned_n_s if started_us == self.started_us else (0.0, 0.0, 0.0)
        self.started_us, self.impulse_ned_n_s = started_us, (x, y, z)
        return math.dist((x, y, z), before)


# --- the flight

# The detector learns the vehicle: its shaking in 0.5 s, how its velocity keeps to its accelerometer in 20 velocities at
# 30 Hz; the velocity filter looks back 0.5 s.
FREE_FLIGHT_S = (1.5, 1.9)
SWITCHED_ON_AFTER_S = 0.5
# Touches later than planned: a slow vehicle whose last centimetres were not in the plan.
PATIENCE_S = 3.0
# From the first touch on: the longest contact is 0.12 s, its aftermath is in the velocity after 0.1 s more.
FOLLOWED_S = 0.45


START_NED_M = np.array([0.0, 0.0, -HEIGHT_M])


def on_its_way(
    case: HitCase, airframe: Airframe, free_flight_s: tuple[float, float], offset_share: float, any_side: bool = False
) -> tuple[SimulatedVehicle, Floats, float]:
    """The vehicle in free flight, nose ahead or anywhere; its velocity, and how long until it meets the obstacle."""
    rng = np.random.default_rng([case.seed, 1])
    velocity, free_s = velocity_towards(case, airframe, rng), float(rng.uniform(*free_flight_s))
    yaw_rad = float(rng.uniform(-math.pi, math.pi)) if any_side else None
    place = START_NED_M + free_s * velocity
    obstacle = obstacle_before(case, airframe, place, velocity, rng, offset_share)
    vehicle = SimulatedVehicle(airframe, Scene.model_validate(obstacle), case.seed)
    if case.approach == "ceiling":
        # Stored so that it may be less than PX4 lets anybody ask for.
        vehicle.parameters["MPC_Z_V_AUTO_UP"] = -float(velocity[2])
    vehicle.begin_in_flight(vector(START_NED_M), vector(velocity), yaw_rad)
    return vehicle, velocity, free_s


class NoTouch(Exception):  # noqa: N818 - reads as the sentence it is
    """The vehicle went past the obstacle: the case is at fault, not a detector."""


def hit_of(case: HitCase, airframe: Airframe) -> HeardHit:
    """The case's flight; one past a pole is flown again nearer to its middle. Raises NoTouch."""
    for share in POLE_OFFSET_SHARES[:-1] if case.approach == "pole" else ():
        with suppress(NoTouch):
            return fly_hit(case, airframe, share)
    return fly_hit(case, airframe, POLE_OFFSET_SHARES[-1])


def fly_hit(case: HitCase, airframe: Airframe, offset_share: float = POLE_OFFSET_SHARES[0]) -> HeardHit:
    """Straight on into the obstacle, and on for a moment. Raises NoTouch."""
    vehicle, velocity, free_s = on_its_way(case, airframe, FREE_FLIGHT_S, offset_share, any_side=True)
    ears = {rate: _ear(vehicle, rate) for rate in ASKED_HZ}
    heard: dict[int, list[HeardStep]] = {rate: [] for rate in ASKED_HZ}
    contact, contact_m_s2 = _Contact(), dict[int, float]()
    hit_row, interval_s = vehicle.state.hit, 1e-6 * vehicle.interval_us
    left, touched = round((free_s + PATIENCE_S) / interval_s), False
    while left > 0:
        vehicle.advance()
        left, now_us = left - 1, vehicle.time_boot_us
        contact_m_s2[now_us] = contact.added_n_s(hit_row) / (airframe.mass_kg * interval_s)
        off_reason, height_m = "takeoff" if now_us < 1e6 * SWITCHED_ON_AFTER_S else None, -float(vehicle.state.body[2])
        asked_ned_m = vector(START_NED_M + 1e-6 * now_us * velocity)
        situation = Situation(off_reason, True, False, height_m, setpoint_position_ned_m=asked_ned_m)
        for rate, (link, decoder) in ears.items():
            samples = tuple(sample for _, sample in decoder.feed(b"".join(link.take())) if sample is not None)
            if samples:
                heard[rate].append(HeardStep(now_us, samples, situation))
        if not touched and hit_row[HIT_ACTIVE] == 1.0:
            touched, left = True, round(FOLLOWED_S / interval_s)
    if not touched:
        raise NoTouch(f"{case.approach} at {case.speed_m_s} m/s was missed")
    return HeardHit(vehicle.truth.hits_so_far()[0], heard, contact_m_s2)


def _ear(vehicle: SimulatedVehicle, rate: int) -> tuple[Link, Decoder]:
    """A link that is asked for the streams of all detectors together, and who reads it."""
    link, decoder = vehicle.add_link(LinkKind.ONBOARD), Decoder()
    decoder.listen_to(1, 1)
    for stream in wanted_streams(CompanionConfig().streams, tuple(MessageId)):
        asked_hz = ASKED_HZ[rate] if stream.message_id is MessageId.HIGHRES_IMU else stream.asked_hz
        link.streams.set_interval(stream.message_id, 1e6 / asked_hz)
    return link, decoder


# --- what detectors find

# A hit that is reported no later than this after its first touch has been found.
FOUND_WITHIN_US = 400_000


@dataclass(slots=True)
class Found:
    """A reported collision: when its sample was heard, its estimate then, and the final one if there was one."""

    time_boot_us: int
    first: ImpactEstimate
    final: ImpactEstimate


def watch_all(config: CompanionConfig, heard: Sequence[HeardStep]) -> tuple[list[Found], list[ImpactEstimate]]:
    """Collisions reported, and touches that were reported as none."""
    monitor = start_monitor(config, heard[0].time_boot_us)
    found: list[Found] = []
    touches: list[ImpactEstimate] = []
    for step in heard:
        impacts, _ = advance(monitor, step.samples, step.situation, step.time_boot_us)
        for estimate in impacts:
            if estimate.impact.is_collision:
                found.append(Found(step.time_boot_us, estimate, estimate))
            else:
                touches.append(estimate)
        latest = monitor.estimator.estimate
        if found and latest is not None and latest.impact is found[-1].first.impact:
            found[-1].final = latest
    return found, touches
