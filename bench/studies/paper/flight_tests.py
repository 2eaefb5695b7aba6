"""The paper's flight tests, head-on at 1 to 2.5 m/s, foldable and rigid, and on to the 5 m/s of the design."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import GAMMA_S, approach
from bench.studies.paper.claims import claim
from bench.studies.paper.figures import add_legend, draw_position, draw_velocity, mark_paper, new_figure
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import StudyFindings, flown_table, is_lost, worst_overshoot_m

PAPER_SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5)
BEYOND_M_S = (3.0, 4.0, 5.0)
SEEDS = 6


def flights(seeds: int) -> list[StudyFlight]:
    return [
        StudyFlight(
            (airframe, speed_m_s),
            approach(speed_m_s),
            airframe,
            seed,
            is_drawn=seed == 1 and speed_m_s in PAPER_SPEEDS_M_S,
        )
        for airframe in AIRFRAMES
        for speed_m_s in (*PAPER_SPEEDS_M_S, *BEYOND_M_S)
        for seed in range(1, SEEDS + 1)
    ]


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    foldable, rigid = (of(results, airframe, PAPER_SPEEDS_M_S) for airframe in AIRFRAMES)
    seen = [result for result in rigid if not is_lost(result)]
    rebound = [result.first.hit.rebound_speed_m_s / result.first.impact_speed_m_s for result in rigid]
    fast = [result for result in rigid if result.flight.key[1] >= 2.0]
    rows = (
        claim("foldable overshoot", worst_overshoot_m(foldable)),
        claim("foldable again", sum(result.second_hits for result in foldable)),
        claim("rigid ratio", float(np.mean(rebound))),
        claim("rigid again", sum(r.second_hits > 0 for r in fast), flown=len(fast), lost=sum(map(is_lost, fast))),
        claim("rigid overshoot", worst_overshoot_m(seen), flown=len(seen)),
    )
    flown = flown_table(results, lambda r: {"airframe": r.flight.key[0], "m/s": f"{r.flight.key[1]:g}"})
    pictures = {f"flight_tests_{airframe}.png": _figure(results, airframe) for airframe in AIRFRAMES}
    return StudyFindings("Flight tests", rows, pictures, {"Head-on, each speed": flown})


def of(results: Sequence[StudyResult], airframe: str, speeds: Sequence[float]) -> list[StudyResult]:
    """The flights of one airframe at these speeds that hit the wall."""
    return [r for r in results if r.flight.key[0] == airframe and r.flight.key[1] in speeds and r.contacts]


def _figure(results: Sequence[StudyResult], airframe: str) -> Figure:
    """Position and velocity of seed 1 at each of the paper's speeds, one column a speed."""
    title = f"{airframe}: straight into a wall, recovery setpoint γ v_c back (γ = 0.5)"
    figure, axes = new_figure(2, len(PAPER_SPEEDS_M_S), title, width=3.9, height=3.2)
    for column, speed_m_s in enumerate(PAPER_SPEEDS_M_S):
        for result in of(results, airframe, (speed_m_s,)):
            if result.track is None:
                continue
            seen, back_m = "" if result.first.is_detected else ", not seen: its sample was lost", GAMMA_S * speed_m_s
            draw_position(axes[0, column], result.track, f"v_c = {speed_m_s:g} m/s{seen}")
            draw_velocity(axes[1, column], result.track, "")
            mark_paper(axes[0, column], result.track.touch_m - back_m, f"paper: {back_m:g} m back")
            mark_paper(axes[1, column], speed_m_s, f"paper: v_c ≈ {speed_m_s:g} m/s")
    add_legend(figure, axes)
    return figure
