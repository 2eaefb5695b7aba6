"""Walls from any side: 1 to 5 m/s, every direction of the wall to the vehicle's nose."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.studies.paper.claims import ClaimRow, claim, number
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import StudyFindings, flown_table, worst_overshoot_by_estimate_m, worst_overshoot_m

SPEEDS_M_S = (1.0, 2.0, 3.0, 4.0, 5.0)
# Between the flight and the wall's normal, to the left and to the right in turn; beyond the paper.
SLANT_DEG = 30.0
GROUPS = (*((airframe, 0.0) for airframe in AIRFRAMES), ("foldable", SLANT_DEG))
# Turning by this each time fills the circle evenly, however many there are.
GOLDEN_ANGLE_DEG = 137.508
# The airframe looks the same from each quarter, and the same from the left as from the right.
QUARTER_DEG = 90.0


def heading_deg(seed: int) -> float:
    """Direction of flight to the nose, clockwise; the wall stands square to it."""
    return (seed * GOLDEN_ANGLE_DEG) % 360.0


def off_axis_deg(heading: float) -> float:
    """How far from the nearest of front, right, back and left; 45 meets one guard alone."""
    return abs((heading + QUARTER_DEG / 2.0) % QUARTER_DEG - QUARTER_DEG / 2.0)


def flights(seeds: int) -> list[StudyFlight]:
    return [
        _flight(airframe, slant_deg, speed_m_s, seed)
        for airframe, slant_deg in GROUPS
        for speed_m_s in SPEEDS_M_S
        for seed in range(1, seeds + 1)
    ]


def _flight(airframe: str, slant_deg: float, speed_m_s: float, seed: int) -> StudyFlight:
    heading = heading_deg(seed)
    mission = approach(speed_m_s, heading, slant_deg=slant_deg if seed % 2 else -slant_deg)
    return StudyFlight((airframe, speed_m_s, heading, slant_deg), mission, airframe, seed)


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    """By the strictest count, and without what ends the collision before (see `flights.StudyContact`)."""
    square = [r for r in results if r.contacts and (r.flight.key[0], r.flight.key[3]) == ("foldable", 0.0)]
    rows = [row for speed in SPEEDS_M_S for row in _rows(speed, [r for r in square if r.flight.key[1] == speed])]
    return StudyFindings(
        "Walls from any side", rows, tables={"Walls from any side, each speed": flown_table(results, _names)}
    )


def _names(result: StudyResult) -> dict[str, str]:
    airframe, speed_m_s, _, slant_deg = result.flight.key
    return {"": f"{airframe}, slant {slant_deg:g}°", "m/s": f"{speed_m_s:g}"}


def _rows(speed_m_s: float, flown: Sequence[StudyResult]) -> Iterator[ClaimRow]:
    again = [result for result in flown if result.recontacts]
    own = number(round(worst_overshoot_by_estimate_m(flown), 3))
    second = sum(result.second_hits > 0 for result in flown)
    yield claim("any side again", second, speed=speed_m_s, flown=len(flown))
    said = _touches_text(again) if again else f"flights: {len(flown)}"
    yield claim("any side touched", len(again), speed=speed_m_s, said=said)
    yield claim("any side overshoot", worst_overshoot_m(flown), speed=speed_m_s, own=own)


def _touches_text(results: Sequence[StudyResult]) -> str:
    """Where, and how: all of it in the sense in which the strictest count is not zero."""
    sides = ", ".join(f"{side:.0f}°" for side in sorted(off_axis_deg(result.flight.key[2]) for result in results))
    later = [contact for result in results for contact in result.contacts[1:]]
    gaps_ms = [
        1e-3 * (after.hit.contact_at_boot_us - before.hit.ended_at_boot_us)
        for result in results
        for before, after in pairwise(result.contacts)
    ]
    peak_n = max(contact.hit.peak_force_n for contact in later)
    folds_mm = [1e3 * contact.fold_before_m for contact in later]
    return (
        f"wall {sides} off the axes; another guard swings in {min(gaps_ms):.0f} to {max(gaps_ms):.0f} ms after the "
        f"last touch, with up to {peak_n:.0f} N, an arm still {min(folds_mm):.0f} to {max(folds_mm):.0f} mm folded"
    )
