"""`bench detectors`: every collision detector on simulated hits and on hard healthy flights."""

import math
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

import pandas as pd

from bench.cases.hits import HandCase, HitCase, draw_case, draw_hand
from bench.cases.mishaps import AIRBORNE_S, FAMILIES, FlightCase
from bench.cases.vehicles import AIRFRAMES
from bench.detectors.config import BaselineConfig
from bench.fly.campaign import Campaign, Json, Results, Workers, run_campaign
from bench.fly.wire import JITTERY
from bench.rows.heard import work_out_flight, work_out_hand, work_out_hit
from bench.rows.tables import Page, bars_text, summary_text
from bench.studies.detector_tables import all_bars, all_tables

# Tried on everything. The others are compared on at least so many hits and flights, and on one in eight at most sizes:
# all seven take three times as long as these two.
THOROUGH = ("fused", "threshold")
COMPARED_HITS, COMPARED_FLIGHTS, COMPARED_EVERY_AT_MOST = 400, 16, 8
# Beside the hits of the airframes as they are, one in so many again with more vibration.
VARIED_SHARE = 16
# An IMU sample's spread on each axis; four public PX4 logs of healthy flights lie between 1.2 and 4 m/s^2.
VIBRATIONS_M_S2 = (0.05, 1.0, 2.0, 4.0)
# Over a bad link, of a hovering vehicle, by hand: one in so many each, by the default detector and the baseline alone.
# No more than these, which take two minutes of one core together; a missed one in a hundred shows.
SIDE_SHARE, SIDE_HITS_AT_MOST, HANDS_AT_MOST = 16, 240, 160
# Take-off, climb, descent and landing come on top of what a flight's manoeuvres take.
FLIGHT_S = AIRBORNE_S + 40.0
OF_FOUND = ("latency_ms", "samples_late", "speed_error_m_s", "normal_error_deg")


def run_detectors(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed."""
    page = Page(options.out, "drawn" if options.vehicles == "drawn" else "detection")
    workers = Workers(options.jobs, options.scheduler)
    campaigns = campaigns_of(options.hits, options.hours, options.first_seed, options.vehicles)
    results = {campaign.name: run_campaign(campaign, workers) for campaign in campaigns}
    frames = {campaign.name: rows(campaign, results[campaign.name]) for campaign in campaigns}
    bars, failed = all_bars(frames), "\n".join(filter(None, (results[one.name].text(one) for one in campaigns)))
    parts = {"What must be shown": bars_text(bars), **all_tables(frames)}
    page.write("Detection", options.typed, parts, rows=frames["hits"])
    print(f"{summary_text(bars)}\n{failed}")
    return 1 if failed else 0


def rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """One for each case, rate and detector: the case's own numbers, the truth's, and what the detector reported."""
    found = []
    for at, result in results.results.items():
        case = {name: value for name, value in asdict(campaign.cases[at]).items() if name != "detectors"}
        truth = {f"true_{name}": value for name, value in result.items() if name != "rates"}
        for rate, heard in result["rates"].items():
            for detector, entry in heard["detectors"].items():
                told = {"possible_ms": heard.get("possible_ms"), **entry}
                found.append({"case": at, **case, **truth, "rate": int(rate), "detector": detector, **told})
    frame = pd.DataFrame(found)
    # A detector that finds nothing tells nothing of it.
    return frame.reindex(columns=[*frame.columns, *(name for name in OF_FOUND if name not in frame.columns)])


def campaigns_of(hits: int, hours: float, first_seed: int, vehicles: str) -> list[Campaign]:
    """Hits, hands and healthy flights by the named vehicles, or each by one of its own."""

    def campaign(name: str, size: dict[str, float], cases: Sequence[Any], work_out: Callable[[Any], Json]) -> Campaign:
        drawn = [replace(case, is_drawn=vehicles == "drawn") for case in cases]
        return Campaign(name, {**size, "first_seed": first_seed, "vehicles": vehicles}, drawn, work_out)

    return [
        campaign("hits", {"hits": hits}, hit_cases(hits, first_seed), work_out_hit),
        campaign("hands", {"hits": hits}, hand_cases(hits, first_seed), work_out_hand),
        campaign("flights", {"hours": hours}, flight_cases(hours, first_seed), work_out_flight),
    ]


def hit_cases(hits: int, first: int) -> list[HitCase]:
    """So many hits as the vehicles are, a sixteenth more that vibrate, and some over a bad link and in hover."""
    every = _every(hits, COMPARED_HITS)
    cases = [draw_case("plain", seed, _compared(seed, every)) for seed in range(first, first + hits)]
    first += hits
    for seed in range(first, first + hits // VARIED_SHARE):
        vibration = VIBRATIONS_M_S2[seed // 2 % len(VIBRATIONS_M_S2)]
        cases.append(draw_case("vibration", seed, _compared(seed, every), vibration_m_s2=vibration))
    first += 2 * hits
    side = _side(hits, SIDE_HITS_AT_MOST)
    cases += [draw_case("link", first + count, THOROUGH, link=JITTERY) for count in range(side)]
    cases += [draw_case("struck", first + hits + count, THOROUGH, is_struck=True) for count in range(side)]
    return cases


def hand_cases(hits: int, first: int) -> list[HandCase]:
    """A hand's grips on a hovering vehicle, as many as belong to so many hits."""
    return [draw_hand(seed, THOROUGH) for seed in range(first, first + 2 * _side(hits, HANDS_AT_MOST // 2))]


def flight_cases(hours: float, first: int) -> list[FlightCase]:
    """At least so many hours of flight, airframes in turn."""
    count = max(2, math.ceil(3600.0 * hours / FLIGHT_S))
    families, every = list(FAMILIES), _every(count, COMPARED_FLIGHTS)
    return [
        FlightCase(families[seed // 2 % len(families)], seed, AIRFRAMES[seed % 2], _compared(seed, every))
        for seed in range(first, first + count)
    ]


def _side(hits: int, at_most: int) -> int:
    """In pairs, one for each airframe, and never none."""
    return 2 * max(1, min(at_most, hits // SIDE_SHARE) // 2)


def _every(cases: int, compared: int) -> int:
    """One in how many cases is for all detectors."""
    return max(1, min(COMPARED_EVERY_AT_MOST, cases // compared))


def _compared(seed: int, every: int) -> tuple[str, ...]:
    """In pairs, so that both airframes have their turns."""
    return tuple(BaselineConfig.detectors) if seed // 2 % every == 0 else THOROUGH
