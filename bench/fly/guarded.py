"""One hit through the whole wire: a vehicle begins in flight, and a guard watches it into an obstacle and to rest.

What a mission's flight has besides, take-off, the way to the wall and the landing, decides nothing about its hit.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.cases.hits import (
    HEIGHT_M,
    POLE_OFFSET_SHARES,
    Floats,
    HitCase,
    obstacle_before,
    vehicle_of_hit,
)
from bench.cases.vehicles import AIRFRAMES
from bench.fly.cruise import FOLLOWED_S, PATIENCE_S
from bench.fly.moments import Moment
from bench.fly.stepped import Stepped
from bench.fly.wire import FOUND_WITHIN_US
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

# What is met sideways; each as often as the others.
APPROACHES = ("wall", "slanted wall", "leaning wall", "pole")
SPEEDS_M_S = (0.5, 5.0)
# Asked for: every sample there is, and PX4's default onboard stream.
IMU_HZ = (250, 50)
# Until the obstacle is touched. The detector knows what a vehicle shakes after 1 s (`detection.floor`); meeting the
# vehicle takes 0.05 s. Twice as long changes nothing (bench/notes/decisions.md).
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
# Until the first hit may begin, as in `flight`; then moments this far apart: five samples of the slowest IMU stream.
FREE_S, APART_S, MOMENTS = 1.2, 0.1, 4
HITS_A_MOMENT = 12
HITS_AN_APPROACH = MOMENTS * HITS_A_MOMENT
# From a moment to the touch, at least: over a whole period of that stream. A guard that points elsewhere touches
# later, that of a slow vehicle by a tenth of a second.
LEAD_S, LED_PATIENCE_S = (0.01, 0.03), 0.5


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


class FlyingVehicle(SimulatedVehicle):
    """The same vehicle; what it meets may be put there in flight."""

    def meet(self, scene: Scene) -> None:
        """Put its obstacles there, none of them through the vehicle."""
        self._plant.change_world(scene.world())

    def note_hit(self) -> None:
        """Note the hit that still lasts as far as it goes."""
        if self.state.hit[HIT_ACTIVE] == 1.0:
            self.truth.add_hit(self.state.hit, self._plant.world)


class Flight(Stepped):
    """A vehicle in flight, and the guard that meets it over the wire."""

    vehicle: FlyingVehicle

    def __init__(self, vehicle: FlyingVehicle, guard: Guard) -> None:
        super().__init__(vehicle, guard)
        self.guard = guard
        self.links[0].introduce()


def velocity_of(hit: HitCase, rng: np.random.Generator) -> Floats:
    """The first that is drawn of a hit."""
    heading_rad = rng.uniform(-math.pi, math.pi)
    return hit.speed_m_s * np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])


def begun(case: FlownHit, scene: Scene, keeps_path: bool) -> Flight:
    """At HEIGHT_M, steadily on the way with the velocity of the hit."""
    built, velocity = vehicle_of_hit(case.hit), velocity_of(case.hit, np.random.default_rng([case.hit.seed, 1]))
    vehicle = FlyingVehicle(built.airframe, scene, case.hit.seed, keeps_path)
    vehicle.begin_in_flight((0.0, 0.0, -HEIGHT_M), (float(velocity[0]), float(velocity[1]), 0.0))
    streams = {"highres_imu_hz": float(case.imu_hz), "window_s": WINDOW_S}
    return Flight(vehicle, Guard(GuardConfig.model_validate({"companion": {**built.settings, "streams": streams}})))


def fly(case: FlownHit) -> tuple[SimulatedVehicle, Guard, int | None]:
    """To rest, or as long as may be; the boot time from which it rested."""
    hit, rng = case.hit, np.random.default_rng([case.hit.seed, 1])
    velocity, free_s = velocity_of(hit, rng), float(rng.uniform(*FREE_FLIGHT_S))
    at, share = np.array([0.0, 0.0, -HEIGHT_M]) + free_s * velocity, POLE_OFFSET_SHARES[0]
    scene = obstacle_before(hit, vehicle_of_hit(hit).airframe, at, velocity, rng, share)
    flight = begun(case, Scene.model_validate(scene), keeps_path=True)
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


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of one hit. Times are the vehicle's, and None where nothing was touched, or told."""

    touched_us: float | None
    closing_m_s: float
    told_us: int | None

    @property
    def is_early(self) -> bool:
        """Whether the guard told of a hit before there was one."""
        return self.told_us is not None and (self.touched_us is None or self.told_us < self.touched_us)

    @property
    def late_us(self) -> float | None:
        """From the touch to the sample that showed it; None of a hit that was missed."""
        if self.told_us is None or self.touched_us is None:
            return None
        late_us = self.told_us - self.touched_us
        return late_us if 0.0 <= late_us <= FOUND_WITHIN_US else None


def approach_of(number: int) -> str:
    """What the hit of this number met: each as often as the others."""
    return APPROACHES[number % len(APPROACHES)]


class Approach:
    """A vehicle on its way through free air; what it meets is put before it."""

    def __init__(self, case: FlownHit) -> None:
        self.case, self.flight = case, begun(case, Scene(), keeps_path=False)

    @property
    def is_false(self) -> bool:
        """Whether the guard told of a hit in free air."""
        return bool(self.flight.guard.collisions())

    def hits(self) -> Iterator[tuple[Scene, Verdict]]:
        """What was met, and what became of it. After a false alarm there are no more."""
        for number in range(HITS_AN_APPROACH):
            if number % HITS_A_MOMENT == 0:
                self.fly_until(FREE_S + number // HITS_A_MOMENT * APART_S)
                moment = self.moment()
            if self.is_false:
                return
            rng = np.random.default_rng([self.case.hit.seed, 2, number])
            scene = self.scene(approach_of(number), float(rng.uniform(*LEAD_S)), rng)
            self.flight.vehicle.meet(scene)
            yield scene, followed(self.flight, LED_PATIENCE_S)
            moment.rewind()

    def fly_until(self, time_s: float) -> None:
        while self.flight.vehicle.time_boot_us < 1e6 * time_s and not self.is_false:
            self.flight.step()

    def moment(self) -> Moment:
        return Moment(self.flight)

    def scene(self, met: str, lead_s: float, rng: np.random.Generator) -> Scene:
        """What is to be met after so long."""
        body, hit = self.flight.vehicle.state.body, replace(self.case.hit, approach=met)
        velocity, airframe = body[3:6].copy(), vehicle_of_hit(hit).airframe
        at = body[:3] + lead_s * velocity
        return Scene.model_validate(obstacle_before(hit, airframe, at, velocity, rng, POLE_OFFSET_SHARES[0]))


def followed(flight: Flight, patience_s: float) -> Verdict:
    """On until the guard tells of a hit, or as long as one is waited for."""
    vehicle, guard = flight.vehicle, flight.guard
    hit_row, truth = vehicle.state.hit, vehicle.truth
    until_us, is_touched, told_us = vehicle.time_boot_us + round(1e6 * patience_s), False, None
    while told_us is None and vehicle.time_boot_us < until_us:
        flight.step()
        if not is_touched and (hit_row[HIT_ACTIVE] == 1.0 or truth.hits):
            is_touched, until_us = True, vehicle.time_boot_us + round(1e6 * FOLLOWED_S)
        told_us = next((collision.sample_time_boot_us for collision in guard.collisions()), None)
    if not is_touched and told_us is not None:
        flight.step()  # of a touch at an interval's very end the truth is noted in the next
    vehicle.note_hit()
    if not truth.hits:
        return Verdict(None, 0.0, told_us)
    return Verdict(truth.hits[0].contact_at_boot_us, truth.hits[0].closing_speed_m_s, told_us)
