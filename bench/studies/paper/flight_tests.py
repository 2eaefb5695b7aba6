"""The paper's flight tests, head-on at 1 to 2.5 m/s, foldable and rigid, and on to the 5 m/s of the design."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import GAMMA_S, approach
from bench.rows.tables import table
from bench.studies.paper.figures import add_legend, draw_position, draw_velocity, mark_paper, new_figure
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import (
    NO_OVERSHOOT_M,
    ClaimRow,
    StudyFindings,
    around,
    at_least,
    at_most,
    cells,
    is_lost,
    worst_overshoot_m,
)

PAPER_SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5)
BEYOND_M_S = (3.0, 4.0, 5.0)
SEEDS = 6


def flights(seeds: int) -> list[StudyFlight]:
    return [
        StudyFlight((airframe, speed_m_s), approach(speed_m_s), airframe, seed, is_drawn=seed == 1)
        for airframe in AIRFRAMES
        for speed_m_s in (*PAPER_SPEEDS_M_S, *BEYOND_M_S)
        for seed in range(1, SEEDS + 1)
    ]


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    pictures = {}
    for airframe in AIRFRAMES:
        pictures[f"flight_tests_{airframe}.png"] = _figure(results, airframe, PAPER_SPEEDS_M_S)
        pictures[f"beyond_{airframe}.png"] = _figure(results, airframe, BEYOND_M_S)
    return StudyFindings("Flight tests", _rows(results), pictures, _tables(results))


def of(results: Sequence[StudyResult], airframe: str, speeds: Sequence[float]) -> list[StudyResult]:
    """The flights of one airframe at these speeds that hit the wall."""
    return [r for r in results if r.flight.key[0] == airframe and r.flight.key[1] in speeds and r.contacts]


def _rows(results: Sequence[StudyResult]) -> tuple[ClaimRow, ...]:
    foldable = of(results, "foldable", PAPER_SPEEDS_M_S)
    rigid = of(results, "rigid", PAPER_SPEEDS_M_S)
    seen = [result for result in rigid if not is_lost(result)]
    rebound = [result.first.hit.rebound_speed_m_s / result.first.impact_speed_m_s for result in rigid]
    fast_rigid = [r for r in rigid if r.flight.key[1] >= 2.0]
    return (
        at_most(
            "foldable, 1 to 2.5 m/s: overshoot", "none", NO_OVERSHOOT_M, worst_overshoot_m(foldable), "m", "largest"
        ),
        at_most("foldable, 1 to 2.5 m/s: second hits", "none", 0.0, sum(r.second_hits for r in foldable), "hits"),
        around("rigid: speed after over speed before", "≈ 1", 1.0, float(np.mean(rebound)), "", 0.2, "mean"),
        at_least(
            "rigid, 2 and 2.5 m/s: flights with a second hit",
            "at least one of two (fig. at 2 m/s)",
            1.0,
            sum(r.second_hits > 0 for r in fast_rigid),
            f"of {len(fast_rigid)}",
            f"{sum(is_lost(r) for r in fast_rigid)} of them lost the sample that held the hit; see the causes",
        ),
        at_least(
            "rigid, hit seen: overshoot",
            "yes, growing with speed",
            NO_OVERSHOOT_M,
            worst_overshoot_m(seen),
            "m",
            f"largest of {len(seen)} flights; damped gains and a level hit, see the causes",
        ),
    )


def _tables(results: Sequence[StudyResult]) -> dict[str, str]:
    rows = [
        {"airframe": airframe, "m/s": f"{speed:g}", **cells(some)}
        for airframe in AIRFRAMES
        for speed in (*PAPER_SPEEDS_M_S, *BEYOND_M_S)
        if (some := of(results, airframe, (speed,)))
    ]
    return {"Head-on, each speed": table(rows)}


def _figure(results: Sequence[StudyResult], airframe: str, speeds: Sequence[float]) -> Figure:
    """Position and velocity of seed 1 at each speed, one column a speed."""
    title = f"{airframe}: straight into a wall, recovery setpoint γ v_c back (γ = 0.5)"
    figure, axes = new_figure(2, len(speeds), title, width=3.9, height=3.2)
    for column, speed_m_s in enumerate(speeds):
        for result in of(results, airframe, (speed_m_s,)):
            if result.track is None:
                continue
            seen = "" if result.first.is_detected else ", not seen: its sample was lost"
            draw_position(axes[0, column], result.track, f"v_c = {speed_m_s:g} m/s{seen}")
            draw_velocity(axes[1, column], result.track, "")
            if speed_m_s in PAPER_SPEEDS_M_S:
                back_m = GAMMA_S * speed_m_s
                mark_paper(axes[0, column], result.track.touch_m - back_m, f"paper: {back_m:g} m back")
                mark_paper(axes[1, column], speed_m_s, f"paper: v_c ≈ {speed_m_s:g} m/s")
    add_legend(figure, axes)
    return figure
