"""The campaigns of the bench: how many cases of which family."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bench.campaign.plan import Campaign, Json
from bench.detectors.flights import AIRBORNE_S, FlightCase, work_out_flight
from bench.detectors.hands import draw_hand, work_out_hand
from bench.detectors.hits import HitCase, draw_case, work_out_hit
from bench.detectors.links import JITTERY
from bench.detectors.mishaps import FAMILIES
from bench.detectors.recorded import (
    SCALES,
    STRIKE_LOG,
    HealthyCase,
    InjectedCase,
    data_files,
    work_out_healthy,
    work_out_injected,
)
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import detector_names

# Tried on everything. The others are compared on at least so many hits and flights, and on one in eight at most sizes:
# all seven take three times as long as these two.
THOROUGH = ("fused", "threshold")
COMPARED_HITS, COMPARED_FLIGHTS, COMPARED_EVERY_AT_MOST = 400, 16, 8
# Of these so many are heard at other thresholds too: seven detectors at seven thresholds take fifty times as long.
SWEPT_HITS = 200

# Beside the hits of the airframes as they are, one in so many again with more vibration, and with a worse velocity.
VARIED_SHARE = 16
# An IMU sample's spread on each axis: four public PX4 logs of healthy flights lie between 1.2 and 4 m/s^2.
VIBRATIONS_M_S2 = (0.05, 1.0, 2.0, 4.0)
# Of the vehicle's velocity estimate, RMS on each axis: motion capture, GPS with RTK, plain GPS.
VELOCITY_NOISES_M_S = (0.01, 0.06, 0.1, 0.2)
# Over a bad link, of a hovering vehicle, by hand: one in so many each, by the default detector and the baseline alone.
# No more than these, which take two minutes of one core together; a missed one in a hundred shows.
SIDE_SHARE, SIDE_HITS_AT_MOST, HANDS_AT_MOST = 16, 240, 160
USES = ("bench.baselines", "bench.random_missions")

# Take-off, climb, descent and landing come on top of what a flight's manoeuvres take.
FLIGHT_S = AIRBORNE_S + 40.0


@dataclass(frozen=True, slots=True)
class Drawing:
    """The seed of the first case, and whether each case has a vehicle of its own."""

    first_seed: int = 0
    is_drawn: bool = False

    def campaign(
        self, name: str, size: Mapping[str, float], cases: Sequence[Any], work_out: Callable[[Any], Json]
    ) -> Campaign:
        parameters = {**size, "first_seed": self.first_seed, "vehicles": "drawn" if self.is_drawn else "named"}
        drawn = [replace(case, is_drawn=self.is_drawn) for case in cases]
        return Campaign(name, parameters, drawn, work_out, USES)


NAMED = Drawing()


def hits_campaign(hits: int, drawing: Drawing = NAMED) -> Campaign:
    """So many hits as the vehicles are, a sixteenth more of each variation, and some over a bad link and in hover."""
    every, first = _every(hits, COMPARED_HITS), drawing.first_seed
    swept = every * max(1, round(hits / (every * SWEPT_HITS)))
    cases: list[HitCase] = [
        draw_case("plain", seed, _compared(seed, every), sweeps=_is_turn(seed, swept))
        for seed in range(first, first + hits)
    ]
    first += hits
    for seed in range(first, first + hits // VARIED_SHARE):
        level = VIBRATIONS_M_S2[seed // 2 % len(VIBRATIONS_M_S2)]
        cases.append(draw_case("vibration", seed, _compared(seed, every), vibration_m_s2=level))
    first += hits
    for seed in range(first, first + hits // VARIED_SHARE):
        noise = VELOCITY_NOISES_M_S[seed // 2 % len(VELOCITY_NOISES_M_S)]
        cases.append(draw_case("velocity", seed, _thorough(), velocity_noise_m_s=noise))
    first += hits
    side = _side(hits, SIDE_HITS_AT_MOST)
    cases += [draw_case("link", first + count, _thorough(), link=JITTERY) for count in range(side)]
    cases += [draw_case("struck", first + hits + count, _thorough(), is_struck=True) for count in range(side)]
    return drawing.campaign("hits", {"hits": hits}, cases, work_out_hit)


def hands_campaign(hits: int, drawing: Drawing = NAMED) -> Campaign:
    """A hand's grips on a hovering vehicle, as many as belong to so many hits."""
    first, count = drawing.first_seed, 2 * _side(hits, HANDS_AT_MOST // 2)
    cases = [draw_hand(seed, _thorough()) for seed in range(first, first + count)]
    return drawing.campaign("hands", {"hits": hits}, cases, work_out_hand)


def flights_campaign(hours: float, drawing: Drawing = NAMED) -> Campaign:
    """At least so many hours of flight, airframes in turn."""
    count = max(2, math.ceil(3600.0 * hours / FLIGHT_S))
    families, every = list(FAMILIES), _every(count, COMPARED_FLIGHTS)
    cases = [
        FlightCase(
            family=families[seed // 2 % len(families)],
            seed=seed,
            airframe=AIRFRAMES[seed % 2],
            detectors=_compared(seed, every),
            sweeps=_is_turn(seed, 2 * every),
        )
        for seed in range(drawing.first_seed, drawing.first_seed + count)
    ]
    return drawing.campaign("flights", {"hours": hours}, cases, work_out_flight)


def healthy_campaign(folder: Path, detectors: tuple[str, ...] | None = None) -> Campaign:
    """Every recorded flight, at half, whole and double magnitude; by all detectors, or these. Raises DataError."""
    logs, _ = data_files(folder)
    cases = [HealthyCase(str(folder), log, scale, detectors or detector_names()) for scale in SCALES for log in logs]
    return Campaign("recorded-flights", {"logs": logs, "by": detectors}, cases, work_out_healthy, USES)


def injected_campaign(folder: Path, rounds: int, detectors: tuple[str, ...] | None = None) -> Campaign:
    """Every recorded impact so many times, each time in another flight; the first time by all detectors, or always by
    these. Raises DataError."""
    logs, drops = data_files(folder)
    healthy = [log for log in logs if log != STRIKE_LOG]
    cases = []
    for turn in range(rounds):
        by = detectors or (detector_names() if turn == 0 else _thorough())
        for number, drop in enumerate(drops):
            log, seed = healthy[(number + turn) % len(healthy)], turn * len(drops) + number
            cases.append(InjectedCase(str(folder), log, drop, seed, by))
    parameters = {"logs": healthy, "rounds": rounds, "by": detectors}
    return Campaign("recorded-impacts", parameters, cases, work_out_injected, USES)


def _side(hits: int, at_most: int) -> int:
    """In pairs, one for each airframe, and never none."""
    return 2 * max(1, min(at_most, hits // SIDE_SHARE) // 2)


def _every(cases: int, compared: int) -> int:
    """One in how many cases is for all detectors."""
    return max(1, min(COMPARED_EVERY_AT_MOST, cases // compared))


def _is_turn(seed: int, every: int) -> bool:
    """In pairs, so that both airframes have their turns."""
    return seed // 2 % every == 0


def _compared(seed: int, every: int) -> tuple[str, ...]:
    return detector_names() if _is_turn(seed, every) else _thorough()


def _thorough() -> tuple[str, ...]:
    return tuple(name for name in detector_names() if name in THOROUGH) or detector_names()
