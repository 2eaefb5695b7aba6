"""Walls from any side: 1 to 5 m/s, every direction of the wall to the vehicle's nose."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.rows.tables import table
from bench.studies.paper.figures import finish, new_figure
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import (
    NO_OVERSHOOT_M,
    ClaimRow,
    StudyFindings,
    at_most,
    cells,
    number,
    worst_overshoot_by_estimate_m,
    worst_overshoot_m,
)

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
    foldable = _group(results, "foldable", 0.0)
    return StudyFindings("Walls from any side", _rows(foldable), {"directions.png": _figure(results)}, _tables(results))


def _group(results: Sequence[StudyResult], airframe: str, slant_deg: float) -> list[StudyResult]:
    keys = (airframe, slant_deg)
    return [r for r in results if (r.flight.key[0], r.flight.key[3]) == keys and r.contacts]


def _rows(foldable: Sequence[StudyResult]) -> tuple[ClaimRow, ...]:
    rows = []
    for speed_m_s in SPEEDS_M_S:
        flown = [result for result in foldable if result.flight.key[1] == speed_m_s]
        name, count = f"foldable, {speed_m_s:g} m/s, any side", f"flights: {len(flown)}"
        again = [result for result in flown if result.recontacts]
        own_m = worst_overshoot_by_estimate_m(flown)
        rows += [
            at_most(f"{name}: second hits", "none", 0.0, sum(r.second_hits > 0 for r in flown), "flights", count),
            at_most(
                f"{name}: touched again",
                "not stated",
                0.0,
                len(again),
                "flights",
                _touches_text(again) if again else count,
            ),
            at_most(
                f"{name}: overshoot",
                "none",
                NO_OVERSHOOT_M,
                worst_overshoot_m(flown),
                "m",
                f"largest, by the truth; {number(round(own_m, 3))} m by the vehicle's own estimate",
            ),
        ]
    return tuple(rows)


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


def _tables(results: Sequence[StudyResult]) -> dict[str, str]:
    """By the strictest count, and without what ends the collision before (see `flights.StudyContact`)."""
    rows = []
    for airframe, slant_deg in GROUPS:
        flown = _group(results, airframe, slant_deg)
        by_speed = {speed: [result for result in flown if result.flight.key[1] == speed] for speed in SPEEDS_M_S}
        name = f"{airframe}, slant {slant_deg:g}°"
        rows += [{"": name, "m/s": f"{speed:g}", **cells(some)} for speed, some in by_speed.items() if some]
    return {"Walls from any side, each speed": table(rows)}


def _figure(results: Sequence[StudyResult]) -> Figure:
    figure, axes = new_figure(
        1, 2, "Walls from any side: how far the hit makes the vehicle lean into the wall", width=6.0
    )
    for axis, airframe in zip(axes[0], AIRFRAMES, strict=True):
        for speed_m_s in SPEEDS_M_S:
            flown = [r for r in _group(results, airframe, 0.0) if r.flight.key[1] == speed_m_s]
            sides = [off_axis_deg(result.flight.key[2]) for result in flown]
            leans = [np.degrees(result.greatest_lean_rad) for result in flown]
            (line,) = axis.plot(sides, leans, "o", markersize=4, label=f"{speed_m_s:g} m/s")
            again = [(x, y) for x, y, result in zip(sides, leans, flown, strict=True) if result.recontacts]
            if again:
                axis.plot(*zip(*again, strict=True), "o", markersize=11, fillstyle="none", color=line.get_color())
        axis.plot([], [], "o", markersize=11, fillstyle="none", color="0.3", label="ring: hit again")
        axis.set_xlim(-1.0, 46.0)
        finish(
            axis,
            airframe,
            "greatest lean into the wall [°]",
            "side of the wall: 0° two guards together, 45° one alone [°]",
        )
        axis.legend(fontsize=8, loc="upper center", ncols=2)
        axis.set_ylim(0.0, 115.0)
    return figure
