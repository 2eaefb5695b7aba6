"""The paper's flight tests, head-on, and walls from any side."""

import pandas as pd
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import GAMMA_S, approach
from bench.rows.paper import StudyFlight
from bench.studies.paper.figures import add_legend, draw_flight, mark_paper, new_figure
from bench.studies.paper.study import Findings, Study, claim, flown_table, number

# --- the paper's flight tests, head-on at 1 to 2.5 m/s, and on to the 5 m/s of its design

PAPER_SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5)
BEYOND_M_S = (3.0, 4.0, 5.0)
SEEDS = 6


def _head_on(seeds: int) -> list[StudyFlight]:
    return [
        StudyFlight(
            {"speed_m_s": speed}, approach(speed), airframe, seed, is_drawn=seed == 1 and speed in PAPER_SPEEDS_M_S
        )
        for airframe in AIRFRAMES
        for speed in (*PAPER_SPEEDS_M_S, *BEYOND_M_S)
        for seed in range(1, SEEDS + 1)
    ]


def _of_head_on(flights: pd.DataFrame) -> Findings:
    hits = flights[(flights["hits"] > 0) & flights["speed_m_s"].isin(PAPER_SPEEDS_M_S)]
    foldable, rigid = (hits[hits["airframe"] == airframe] for airframe in AIRFRAMES)
    seen, fast = rigid[~rigid["lost"].astype(bool)], rigid[rigid["speed_m_s"] >= 2.0]
    rows = (
        claim("foldable overshoot", foldable["past_m"].max()),
        claim("foldable again", foldable["second_hits"].sum()),
        claim("rigid ratio", (rigid["rebound_m_s"] / rigid["impact_m_s"]).mean()),
        claim("rigid again", (fast["second_hits"] > 0).sum(), flown=len(fast), lost=fast["lost"].sum()),
        claim("rigid overshoot", seen["past_m"].max(), flown=len(seen)),
    )
    pictures = {f"flight_tests_{name}.png": _figure(name, hits[hits["airframe"] == name]) for name in AIRFRAMES}
    return Findings(rows, pictures, {"Head-on, each speed": flown_table(flights, airframe="airframe", speed_m_s="m/s")})


def _figure(airframe: str, flights: pd.DataFrame) -> Figure:
    """Position and velocity of seed 1 at each of the paper's speeds, one column a speed."""
    title = f"{airframe}: straight into a wall, recovery setpoint γ v_c back (γ = 0.5)"
    figure, axes = new_figure(2, len(PAPER_SPEEDS_M_S), title, width=3.9, height=3.2)
    for flight in flights[flights["track"].notna()].itertuples():
        column, speed_m_s = PAPER_SPEEDS_M_S.index(flight.speed_m_s), flight.speed_m_s
        seen, back_m = "" if flight.seen else ", not seen: its sample was lost", GAMMA_S * speed_m_s
        draw_flight(axes[:, column], flight.track, (f"v_c = {speed_m_s:g} m/s{seen}", ""))
        mark_paper(axes[0, column], flight.track["touch_m"] - back_m, f"paper: {back_m:g} m back")
        mark_paper(axes[1, column], speed_m_s, f"paper: v_c ≈ {speed_m_s:g} m/s")
    add_legend(figure)
    return figure


# --- walls from any side: every direction of the wall to the vehicle's nose

ANY_SIDE_M_S = (1.0, 2.0, 3.0, 4.0, 5.0)
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


def _from_any_side(seeds: int) -> list[StudyFlight]:
    return [
        StudyFlight(
            {"speed_m_s": speed, "heading_deg": heading_deg(seed), "slant_deg": slant_deg},
            approach(speed, heading_deg(seed), slant_deg=slant_deg if seed % 2 else -slant_deg),
            airframe,
            seed,
        )
        for airframe, slant_deg in GROUPS
        for speed in ANY_SIDE_M_S
        for seed in range(1, seeds + 1)
    ]


def _of_any_side(flights: pd.DataFrame) -> Findings:
    """By the strictest count, and without what ends the collision before (see `bench/rows/paper.py`)."""
    square = flights[(flights["hits"] > 0) & (flights["airframe"] == "foldable") & (flights["slant_deg"] == 0.0)]
    rows = []
    for speed, flown in square.groupby("speed_m_s"):
        again, own_m = flown[flown["again"] > 0], float(flown["own_past_m"].max())
        said = _touches_text(again) if len(again) else f"flights: {len(flown)}"
        rows += [
            claim("any side again", (flown["second_hits"] > 0).sum(), speed=speed, flown=len(flown)),
            claim("any side touched", len(again), speed=speed, said=said),
            claim("any side overshoot", flown["past_m"].max(), speed=speed, own=number(round(own_m, 3))),
        ]
    flown_text = flown_table(flights, airframe="airframe", slant_deg="slant [°]", speed_m_s="m/s")
    return Findings(rows, tables={"Walls from any side, each speed": flown_text})


def _touches_text(flights: pd.DataFrame) -> str:
    """Where, and how: all of it in the sense in which the strictest count is not zero."""
    sides = ", ".join(f"{side:.0f}°" for side in sorted(map(off_axis_deg, flights["heading_deg"])))
    gaps_ms, folds_mm = (1e3 * flights[name].explode().astype(float) for name in ("gaps_s", "later_folds_m"))
    peak_n = flights["later_peaks_n"].explode().max()
    return (
        f"wall {sides} off the axes; another guard swings in {gaps_ms.min():.0f} to {gaps_ms.max():.0f} ms after the "
        f"last touch, with up to {peak_n:.0f} N, an arm still {folds_mm.min():.0f} to {folds_mm.max():.0f} mm folded"
    )


FLIGHT_TESTS = Study("Flight tests", _head_on, _of_head_on)
ANY_SIDE = Study("Walls from any side", _from_any_side, _of_any_side)
