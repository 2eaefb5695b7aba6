"""The paper's sample scenario: missions/paper.yaml, its figures b to d."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bench.paper.approach import pinned
from bench.paper.figures import (
    add_legend,
    draw_fold,
    draw_position,
    draw_velocity,
    finish,
    mark_moments,
    mark_paper,
    new_figure,
)
from bench.paper.flights import GAMMA_S, StudyFlight, StudyResult, StudyTrack
from bench.paper.studies.arm import FOLD_MAX_M
from bench.paper.study import StudyFindings, sampling_text
from bench.paper.table import ClaimRow, around
from rebound_cli.inputs import load_mission_document

MISSION_FILE = Path("missions/paper.yaml")
SEED = 1

# The paper, section IV.
CROSSING_M_S, CONTACT_AFTER_S, IMPACT_M_S, REBOUND_M_S = 1.5, 0.2, 1.4, 0.28


def flights(seeds: int) -> list[StudyFlight]:
    mission = pinned(load_mission_document(MISSION_FILE, []).data)
    return [StudyFlight(("sample",), mission, "foldable", SEED, is_drawn=True)]


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    (result,) = results
    track = result.track
    assert track is not None, "the wall of the sample scenario is hit"
    return StudyFindings(
        "Sample scenario",
        _rows(result, track),
        f"{sampling_text(results)} `rebound fly missions/paper.yaml --lockstep` flies the same, "
        "with the drone's own detector.\n\n"
        "![position, velocity and fold](images/paper/sample_scenario.png)\n",
        {"sample_scenario.png": _figure(track)},
    )


def _rows(result: StudyResult, track: StudyTrack) -> tuple[ClaimRow, ...]:
    contact = result.first
    # x = 0 is crossed by the guards: from there to the touch they travel to the wall's 0.3 m.
    guard_m = track.place_m + (track.wall_m - track.touch_m)
    crossing = int(np.flatnonzero((guard_m < 0.0) & (track.time_s < 0.0))[-1])
    setpoint_ned_m = contact.setpoint_in_world_ned_m
    if setpoint_ned_m is None:
        raise AssertionError("the sample scenario's hit was not detected")
    before_m, setpoint_m = contact.hit.contact_position_ned_m[0], setpoint_ned_m[0]
    back_m = float(before_m - setpoint_m)
    forward_m = float(track.place_m[(track.time_s >= 0.0) & (track.time_s < 0.3)].max() - track.touch_m)
    speed_m_s = contact.impact_speed_m_s
    return (
        around("speed at x = 0 (guards)", "≈ 1.5 m/s", CROSSING_M_S, float(track.speed_m_s[crossing]), "m/s", 0.06),
        around("from there to the contact", "≈ 0.2 s", CONTACT_AFTER_S, -float(track.time_s[crossing]), "s", 0.15),
        around("speed before the contact", "≈ 1.4 m/s", IMPACT_M_S, speed_m_s, "m/s", 0.06),
        around(
            "speed after it",
            "≈ 0.28 m/s",
            REBOUND_M_S,
            contact.hit.rebound_speed_m_s,
            "m/s",
            0.25,
            "0.28 / 1.4 = 0.20; eq. 2 until its force is zero gives 0.22 and 0.31 m/s",
        ),
        around(
            "setpoint by eq. 3, back from x(t_c)",
            "γ v_c = 0.5 · 1.4 = 0.70 m",
            GAMMA_S * speed_m_s,
            back_m,
            "m",
            0.12,
            f"from {before_m:.2f} to {setpoint_m:.2f} m; tolerance about γ times our own v_c",
        ),
        around("centre's way into the folding arms", "l, up to 0.03 m", 0.0294, forward_m, "m", 0.08),
    )


def _figure(track: StudyTrack) -> Figure:
    figure, axes = new_figure(2, 2, "The paper's sample scenario: wall 0.3 m ahead, target 2 m ahead")
    draw_position(axes[0, 0], track, "b: position", -0.5, 3.0)
    draw_velocity(axes[0, 1], track, "c: velocity", -0.5, 3.0)
    mark_paper(axes[0, 1], IMPACT_M_S, f"paper: hits at {IMPACT_M_S:g} m/s")
    mark_paper(axes[0, 1], -REBOUND_M_S, f"paper: rebounds at {REBOUND_M_S:g} m/s")
    zoom = axes[1, 0]
    near = (track.time_s >= -0.05) & (track.time_s <= 0.3)
    zoom.plot(track.time_s[near], track.place_m[near], color="tab:blue", linewidth=1.8, label="vehicle's centre")
    touching = near & (track.fold_m.max(axis=1) > 0.002) & (track.time_s >= 0.0)
    zoom.plot(track.time_s[touching], track.place_m[touching], color="red", linewidth=3.5, label="arms folded (red)")
    zoom.axhline(track.touch_m, color="tab:brown", linewidth=1.0, linestyle=":")
    mark_moments(zoom, track)
    finish(zoom, "d: the centre while the arms fold and unfold", "distance from take-off point\ninto the wall [m]")
    draw_fold(axes[1, 1], track, "fold of each arm", -0.05, 0.3)
    mark_paper(axes[1, 1], 1e3 * FOLD_MAX_M, f"paper: folds by {1e3 * FOLD_MAX_M:g} mm")
    axes[1, 1].set_ylim(top=1e3 * FOLD_MAX_M + 4.0)
    add_legend(figure, axes)
    return figure
