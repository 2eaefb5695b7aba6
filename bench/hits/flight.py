"""One hit through the whole wire: a vehicle begins in flight, and a guard watches it into an obstacle and to rest.

What a mission's flight has besides, take-off, the way to the wall and the landing, decides nothing about its hit.
"""

import math
import resource
from dataclasses import dataclass
from time import process_time

import numpy as np

from bench.campaign.plan import Campaign, Json
from bench.detectors.hits import (
    FOLLOWED_S,
    HEIGHT_M,
    PATIENCE_S,
    POLE_OFFSET_SHARES,
    Floats,
    HitCase,
    obstacle_before,
    vehicle_of_hit,
)
from bench.detectors.scoring import FOUND_WITHIN_US
from bench.detectors.vehicles import AIRFRAMES, BenchVehicle
from bench.random_missions.crashes import tilts_deg
from bench.recoveries.hits import returns
from bench.speed.parse import parse_us
from companion.companion import StepResult
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.report import CollisionReport
from rebound_cli.results.truth_match import LATE_SAMPLE_US, FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.mavlink.link import Link, LinkOptions
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# What is met sideways; each as often as the others.
APPROACHES = ("wall", "slanted wall", "leaning wall", "pole")
SPEEDS_M_S = (0.5, 5.0)
# Asked for: every sample there is, and PX4's default onboard stream.
IMU_HZ = (250, 50)
# Until the obstacle is touched. The detector knows what a vehicle shakes after 1 s (`detection.floor`); meeting the
# vehicle takes 0.05 s. Twice as long changes nothing (bench/notes/hits.md).
FREE_FLIGHT_S = (1.2, 1.4)
# Of the streams' rates, in place of 2 s: ten of the slowest stream that must arrive.
WINDOW_S = 0.5
# At rest: nothing touched, and slower than a hovering vehicle wanders by the worst estimate (0.08 m/s on each axis).
REST_M_S, REST_S = 0.2, 0.3
# A healthy recovery takes 2 to 4 s.
MOST_RECOVERY_S = 5.0
# A vehicle that leans by more is over.
OVERTURNED_DEG = 90.0
# How often the truth is looked at.
LOOK_EVERY = 5
PARSES = 100


@dataclass(frozen=True, slots=True)
class FlownHit:
    """The hit, and the rate asked for of HIGHRES_IMU."""

    hit: HitCase
    imu_hz: int


def draw_flown(seed: int, is_drawn: bool) -> FlownHit:
    """Airframes, rates and approaches in turn, speeds at random."""
    speed_m_s = float(np.random.default_rng([seed, 0]).uniform(*SPEEDS_M_S))
    approach = APPROACHES[seed // 4 % len(APPROACHES)]
    hit = HitCase("flown", seed, AIRFRAMES[seed % 2], approach, round(speed_m_s, 3), (), is_drawn=is_drawn)
    return FlownHit(hit, IMU_HZ[seed // 2 % 2])


def flown_campaign(hits: int, first_seed: int, is_drawn: bool) -> Campaign:
    cases = [draw_flown(seed, is_drawn) for seed in range(first_seed, first_seed + hits)]
    # Not how many: a longer campaign goes on where a shorter one ended.
    parameters = {"first_seed": first_seed, "is_drawn": is_drawn}
    return Campaign("flown-hits", parameters, cases, work_out_flown, ("bench.detectors", "bench.random_missions"))


def work_out_flown(case: FlownHit) -> Json:
    """What became of it by the simulator's truth, and what it cost. SI units."""
    began_s = process_time()
    vehicle, guard, rest_us = fly(case)
    cost_s = process_time() - began_s
    used_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cost = {"processor_s": round(cost_s, 4), "memory_mb": round(used_mb, 1), "parse_us": round(parse_us(PARSES), 2)}
    return {**judged(vehicle, guard.collisions(), rest_us), "cost": cost}


class FlyingVehicle(SimulatedVehicle):
    """The same vehicle; what it meets may be put there in flight."""

    def meet(self, scene: Scene) -> None:
        """Put its obstacles there, none of them through the vehicle."""
        self._plant.change_world(scene.world())

    def note_hit(self) -> None:
        """Note the hit that still lasts as far as it goes."""
        if self.state.hit[HIT_ACTIVE] == 1.0:
            self.truth.add_hit(self.state.hit, self._plant.world)


@dataclass(slots=True)
class Flight:
    """A vehicle in flight, and the guard that meets it over the wire."""

    vehicle: FlyingVehicle
    link: Link
    guard: Guard

    def step(self) -> StepResult:
        """One interval, all bytes both ways."""
        self.vehicle.advance()
        result = self.guard.step(b"".join(self.link.take()), EPOCH_US + self.vehicle.time_boot_us)
        self.link.push(b"".join(result.sent_frames))
        return result


def begun(built: BenchVehicle, case: FlownHit, velocity: Floats, scene: Scene, keeps_path: bool) -> Flight:
    """At HEIGHT_M, steadily on the way with this velocity."""
    vehicle = FlyingVehicle(built.airframe, scene, case.hit.seed, keeps_path)
    vehicle.begin_in_flight((0.0, 0.0, -HEIGHT_M), (float(velocity[0]), float(velocity[1]), 0.0))
    link = vehicle.add_link(LinkOptions(LinkKind.ONBOARD))
    link.introduce()
    streams = {"highres_imu_hz": float(case.imu_hz), "window_s": WINDOW_S}
    guard = Guard(GuardConfig.model_validate({"companion": {**built.settings, "streams": streams}}))
    return Flight(vehicle, link, guard)


def fly(case: FlownHit) -> tuple[SimulatedVehicle, Guard, int | None]:
    """To rest, or as long as may be; the boot time from which it rested."""
    hit, built = case.hit, vehicle_of_hit(case.hit)
    rng = np.random.default_rng([hit.seed, 1])
    heading_rad, free_s = rng.uniform(-math.pi, math.pi), float(rng.uniform(*FREE_FLIGHT_S))
    velocity = hit.speed_m_s * np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
    at, share = np.array([0.0, 0.0, -HEIGHT_M]) + free_s * velocity, POLE_OFFSET_SHARES[0]
    scene = Scene.model_validate(obstacle_before(hit, built.airframe, at, velocity, rng, share))
    flight = begun(built, case, velocity, scene, keeps_path=True)
    return flight.vehicle, flight.guard, to_rest(flight, free_s + PATIENCE_S)


def to_rest(flight: Flight, patience_s: float) -> int | None:
    """On until the vehicle rests, or as long as may be; the boot time from which it rested."""
    vehicle, guard = flight.vehicle, flight.guard
    body, hit_row, truth = vehicle.state.body, vehicle.state.hit, vehicle.truth
    until_us, count = vehicle.time_boot_us + round(1e6 * patience_s), 0
    touched_us = rest_us = None
    is_answered = False
    while vehicle.time_boot_us < until_us:
        flight.step()
        now_us = vehicle.time_boot_us
        count += 1
        if count % LOOK_EVERY:
            continue
        touches = hit_row[HIT_ACTIVE] == 1.0
        if touched_us is None and (touches or truth.hits):
            touched_us, until_us = now_us, now_us + round(1e6 * FOLLOWED_S)
        if touched_us is not None and not is_answered and guard.collisions():
            is_answered, until_us = True, touched_us + round(1e6 * MOST_RECOVERY_S)
        if not is_answered or touches or math.hypot(*body[3:6].tolist()) > REST_M_S:
            rest_us = None
        elif rest_us is None:
            rest_us = now_us
        elif now_us - rest_us >= 1e6 * REST_S:
            break
    else:
        rest_us = None
    vehicle.note_hit()
    return rest_us


def judged(vehicle: SimulatedVehicle, told: tuple[CollisionReport, ...], rest_us: int | None) -> Json:
    """Found: the companion told of the first contact, or of one that a guard's bounce made soon after."""
    hits, series = vehicle.truth.hits, vehicle.truth.series()
    false = sum(not any(_tells_of(hit, collision) for hit in hits) for collision in told)
    result: Json = {"seconds": round(1e-6 * vehicle.time_boot_us, 3), "false": false, "touched": bool(hits)}
    if not hits:
        return result
    first = hits[0]
    touched_us = first.contact_at_boot_us
    after = series["time_boot_us"] >= touched_us
    late_us = [c.sample_time_boot_us - touched_us for c in told if c.sample_time_boot_us >= touched_us]
    is_found = bool(late_us) and late_us[0] <= FOUND_WITHIN_US
    result |= {
        "found": is_found,
        "closing_m_s": round(first.closing_speed_m_s, 3),
        "tilt_deg": round(float(tilts_deg(series["attitude_wxyz"][after]).max()), 1),
        "lost_m": round(max(0.0, float(series["position_ned_m"][after, 2].max()) - first.contact_position_ned_m[2]), 3),
        "rest_s": None if rest_us is None else round(1e-6 * (rest_us - touched_us), 3),
    }
    if is_found:
        until_s = MOST_RECOVERY_S if rest_us is None else 1e-6 * (rest_us - touched_us)
        result["latency_ms"] = round(1e-3 * late_us[0], 1)
        result["again"] = returns(FlightTruth(hits, series, EPOCH_US), np.array(first.normal_ned), until_s)
    return result


def _tells_of(hit: Hit, collision: CollisionReport) -> bool:
    """While the contact lasts, or as soon after its first touch as the detectors' bench calls it found."""
    until_us = max(hit.ended_at_boot_us + LATE_SAMPLE_US, hit.contact_at_boot_us + FOUND_WITHIN_US)
    return hit.contact_at_boot_us <= collision.sample_time_boot_us <= until_us
