"""Walls from any side: 1 to 5 m/s, every direction of the wall to the vehicle's nose."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from rebound_cli.paper.approach import approach
from rebound_cli.paper.figures import finish, new_figure
from rebound_cli.paper.flight_tests import NO_OVERSHOOT_M, is_lost, safety_text, worst_overshoot_m
from rebound_cli.paper.flights import Flight, Result
from rebound_cli.paper.study import Findings, sampling_text
from rebound_cli.paper.table import Row, at_most, markdown, number

SPEEDS_M_S = (1.0, 2.0, 3.0, 4.0, 5.0)
AIRFRAMES = ("foldable", "rigid")
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


def flights(seeds: int) -> list[Flight]:
    return [
        Flight((airframe, speed_m_s, heading_deg(seed)), approach(speed_m_s, heading_deg(seed)), airframe, seed)
        for airframe in AIRFRAMES
        for speed_m_s in SPEEDS_M_S
        for seed in range(1, seeds + 1)
    ]


def conclude(results: Sequence[Result]) -> Findings:
    foldable = [result for result in results if result.flight.key[0] == "foldable" and result.contacts]
    return Findings("Walls from any side", _rows(foldable), _text(results), {"directions.png": _figure(results)})


def _rows(foldable: Sequence[Result]) -> tuple[Row, ...]:
    rows = []
    for speed_m_s in SPEEDS_M_S:
        flown = [result for result in foldable if result.flight.key[1] == speed_m_s]
        again = [result for result in flown if result.recontacts]
        note = _second_hits_text(again) if again else f"flights: {len(flown)}"
        rows.append(
            at_most(f"foldable, {speed_m_s:g} m/s, any side: second hits", "none", 0.0, len(again), "flights", note)
        )
        rows.append(
            at_most(
                f"foldable, {speed_m_s:g} m/s, any side: overshoot",
                "none",
                NO_OVERSHOOT_M,
                worst_overshoot_m(flown),
                "m",
                "largest",
            )
        )
    return tuple(rows)


def _second_hits_text(results: Sequence[Result]) -> str:
    """Where, and of what kind: a guard that swings in while the vehicle leaves, or a vehicle that comes back."""
    sides = ", ".join(f"{side:.0f}°" for side in sorted(off_axis_deg(result.flight.key[2]) for result in results))
    back = sum(result.came_back for result in results)
    return f"wall {sides} off the axes; {back} came back, {len(results) - back} touched again while leaving"


COLUMNS = (
    "m/s",
    "flights",
    "hit seen",
    "first hit lost",
    "flights with a second hit",
    "of these: came back to the wall",
    "overshoot, max [m]",
    "speed after / before, least to most",
    "lean into the wall, max [°]",
    "peak force, max [N]",
    "factor of safety, least",
)


def _text(results: Sequence[Result]) -> str:
    seeds = len(results) // (len(AIRFRAMES) * len(SPEEDS_M_S))
    parts = [
        f"{seeds} flights a speed, seeds 1 to {seeds}. The vehicle flies square at a wall whose side to the nose is "
        f"another one each time (seed · {GOLDEN_ANGLE_DEG}°), which decides what arms are hit and in which order. "
        f"{sampling_text(results)}\n",
        "![second hits and lean over the wall's side](images/paper/directions.png)\n",
    ]
    for airframe in AIRFRAMES:
        flown = [result for result in results if result.flight.key[0] == airframe and result.contacts]
        rows = [_cells(s, [result for result in flown if result.flight.key[1] == s]) for s in SPEEDS_M_S]
        parts.append(f"### {airframe}\n\n" + markdown(COLUMNS, rows))
    return "\n".join(parts)


def _cells(speed_m_s: float, results: Sequence[Result]) -> list[str]:
    rebounds = [result.first.hit.rebound_speed_m_s / result.first.impact_speed_m_s for result in results]
    peak_n = max(contact.hit.peak_force_n for result in results for contact in result.contacts)
    return [
        f"{speed_m_s:g}",
        f"{len(results)}",
        f"{sum(result.first.is_detected for result in results)}",
        f"{sum(is_lost(result) for result in results)}",
        f"{sum(result.recontacts > 0 for result in results)}",
        f"{sum(result.came_back for result in results)}",
        number(round(worst_overshoot_m(results), 3)),
        f"{min(rebounds):.2f} to {max(rebounds):.2f}",
        f"{np.degrees(max(result.greatest_lean_rad for result in results)):.0f}",
        f"{peak_n:.0f}",
        safety_text(peak_n),
    ]


def _figure(results: Sequence[Result]) -> Figure:
    figure, axes = new_figure(
        1, 2, "Walls from any side: how far the hit makes the vehicle lean into the wall", width=6.0
    )
    for axis, airframe in zip(axes[0], AIRFRAMES, strict=True):
        for speed_m_s in SPEEDS_M_S:
            flown = [r for r in results if r.flight.key[:2] == (airframe, speed_m_s) and r.contacts]
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
        axis.legend(fontsize=8)
    return figure
