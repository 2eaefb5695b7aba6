"""Many hits a vehicle: one approach through the whole wire, and from moments of it one hit after the other.

Each hit is flown until the guard tells of it, or may no longer: a recovery says nothing of what was missed. All bytes
go both ways, as in `flight`: there is no second path that could differ.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np

from bench.campaign.plan import Campaign, Json
from bench.detectors.hits import FOLLOWED_S, POLE_OFFSET_SHARES, Floats, HitCase, obstacle_before, vehicle_of_hit
from bench.detectors.scoring import FOUND_WITHIN_US
from bench.detectors.vehicles import BenchVehicle
from bench.hits.flight import APPROACHES, PARSES, Flight, FlownHit, begun, draw_flown
from bench.hits.rewind import Moment
from bench.speed.parse import parse_us
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.scene import Scene

# Until the first hit may begin, as in `flight`; then moments this far apart: five samples of the slowest IMU stream.
FREE_S, APART_S, MOMENTS = 1.2, 0.1, 4
HITS_A_MOMENT = 12
HITS_AN_APPROACH = MOMENTS * HITS_A_MOMENT
# From a moment to the touch, at least: over a whole period of that stream. A guard that points elsewhere touches
# later, that of a slow vehicle by a tenth of a second.
LEAD_S, PATIENCE_S = (0.01, 0.03), 0.5
# By then the companion has decided whether what it told of was a hit (`confirmation.DECIDED_US`).
DECIDED_S = 0.25


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


def verdict_campaign(hits: int, first_seed: int, is_drawn: bool) -> Campaign:
    """As many approaches as it takes for so many hits, if each obstacle is met."""
    seeds = range(first_seed, first_seed + math.ceil(hits / HITS_AN_APPROACH))
    cases = [draw_flown(seed, is_drawn) for seed in seeds]
    parameters = {"first_seed": first_seed, "is_drawn": is_drawn}
    return Campaign("verdicts", parameters, cases, work_out_approach, ("bench.detectors", "bench.random_missions"))


def work_out_approach(case: FlownHit) -> Json:
    """Its hits in the order flown, and whether one of them, flown again from the beginning, is the same."""
    began_s = process_time()
    approach = Approach(case)
    flown = list(approach.hits())
    cost_s = process_time() - began_s
    touched = [(number, verdict) for number, (_, verdict) in enumerate(flown) if verdict.touched_us is not None]
    result: Json = {
        "watched_s": round(1e-6 * approach.flight.vehicle.time_boot_us - FREE_S, 3),
        "false": approach.is_false or any(verdict.is_early for _, verdict in flown),
        "hits": [_entry(number, verdict) for number, verdict in touched if not verdict.is_early],
        "cost": {"processor_s": round(cost_s, 4), "parse_us": round(parse_us(PARSES), 2)},
    }
    if flown:
        scene, verdict = flown[case.hit.seed % len(flown)]
        told, result["kept"] = again(case, scene)
        result["agrees"] = verdict == told
    return result


def _entry(number: int, verdict: Verdict) -> list[Any]:
    """Its number, which says what was met, the speed into the surface, and after how many ms it was found."""
    late_us = verdict.late_us
    return [number, round(verdict.closing_m_s, 3), None if late_us is None else round(1e-3 * late_us, 1)]


def approach_of(number: int) -> str:
    """What the hit of this number met: each as often as the others."""
    return APPROACHES[number % len(APPROACHES)]


class Approach:
    """A vehicle on its way through free air; what it meets is put before it."""

    def __init__(self, case: FlownHit, built: BenchVehicle | None = None) -> None:
        self.case, self.built = case, built or vehicle_of_hit(case.hit)
        self.flight = begun(self.built, case, velocity_of(case.hit), Scene(), keeps_path=False)

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
            yield scene, followed(self.flight, PATIENCE_S)
            moment.rewind()

    def fly_until(self, time_s: float) -> None:
        while self.flight.vehicle.time_boot_us < 1e6 * time_s and not self.is_false:
            self.flight.step()

    def moment(self) -> Moment:
        return Moment(self.flight.vehicle, self.flight.link, self.flight.guard)

    def scene(self, met: str, lead_s: float, rng: np.random.Generator) -> Scene:
        """What is to be met after so long."""
        body, case = self.flight.vehicle.state.body, replace(self.case.hit, approach=met)
        velocity = body[3:6].copy()
        at = body[:3] + lead_s * velocity
        share = POLE_OFFSET_SHARES[0]
        return Scene.model_validate(obstacle_before(case, self.built.airframe, at, velocity, rng, share))


def velocity_of(hit: HitCase) -> Floats:
    heading_rad = np.random.default_rng([hit.seed, 1]).uniform(-math.pi, math.pi)
    return hit.speed_m_s * np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])


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


def again(case: FlownHit, scene: Scene) -> tuple[Verdict, bool]:
    """The same hit by a vehicle that has the obstacle before it from the beginning. Nothing is put there or rewound.

    And whether the guard still counts what it told of when it has decided about it.
    """
    flight = begun(vehicle_of_hit(case.hit), case, velocity_of(case.hit), scene, keeps_path=True)
    verdict = followed(flight, FREE_S + MOMENTS * APART_S + PATIENCE_S)
    decided_us = flight.vehicle.time_boot_us + 1e6 * DECIDED_S
    while verdict.told_us is not None and flight.vehicle.time_boot_us < decided_us:
        flight.step()
    return verdict, bool(flight.guard.collisions()) == (verdict.told_us is not None)
