"""The paper's other claims: contact time, force and safety, size, hover, and what happens without recovery."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from bench.cases.walls import approach
from bench.fly.cruise import head_on
from bench.rows.tables import table
from bench.studies.paper.figures import add_legend, draw_position, draw_velocity, finish, mark_paper, new_figure
from bench.studies.paper.flights import Floats, StudyFlight, StudyResult
from bench.studies.paper.study import (
    ClaimRow,
    StudyFindings,
    around,
    at_least,
    at_most,
    safety_text,
    within_factor,
)
from rebound_cli.results.summary import BREAKING_FORCE_N
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.setpoint import TrajectorySetpoint

# The paper, sections II and V.
FOLDABLE_PULSE_S, RIGID_PULSE_S = 0.025, 0.001
FORCE_N, MASS_KG, SPEED_CHANGE_M_S, STOPPING_TIME_S = 100.0, 1.0, 5.0, 0.05
OPEN_M, FOLDED_M = 0.290, 0.230
HOVER_SHARE = 0.70

# The paper gives round figures and not from where to where it measured; a factor of two would still be caught.
PULSE_FACTOR = 1.7

# Eq. 2 with b_s = 30 and k_s = 500: when b_s l' + k_s l is half of what it begins with.
HALF_FORCE_S = 0.0372

PULSE_SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5, 5.0)
# Never reached: the accelerometer's range is 157 m/s^2.
NEVER_M_S2 = 1.0e6
BOUNCING_M_S = 1.0
# The vehicle is let go with its motors at rest: it falls, climbs back, and its integral unwinds.
SETTLING_S, HOVER_S = 10, 10


@dataclass(frozen=True, slots=True)
class Pulse:
    """What an accelerometer read at 8 kHz would show of a head-on hit."""

    speed_m_s: float
    time_s: Floats
    deceleration_m_s2: Floats
    contact_s: float
    peak_force_n: float

    @property
    def width_s(self) -> float:
        """How long the deceleration is above half of its greatest."""
        step_s = float(self.time_s[1] - self.time_s[0])
        return step_s * int(np.count_nonzero(self.deceleration_m_s2 > 0.5 * self.deceleration_m_s2.max()))


def pulse(name: str, speed_m_s: float) -> Pulse:
    """A single head-on hit with motors off, each raw sample of the sensor by itself, without noise or clipping."""
    data = load_built_in(name).model_dump()
    raw_us = data["imu"]["raw_interval_us"]
    quiet = {key: 0.0 for key in data["imu"] if key.endswith(("noise_m_s2", "bias_m_s2", "noise_rad_s", "bias_rad_s"))}
    data["imu"] |= quiet | {"integration_interval_us": raw_us, "accelerometer_range_m_s2": NEVER_M_S2}
    single = head_on(Airframe.model_validate(data), speed_m_s)
    deceleration = -np.gradient(single.speed_m_s, single.time_s)
    hit = single.hit
    return Pulse(speed_m_s, single.time_s, deceleration, hit.contact_duration_s, hit.peak_force_n)


def hover_share(mass_kg: float) -> float:
    """Thrust commanded in a hover over the greatest: mean over HOVER_S of a hover that has settled."""
    data = load_built_in("foldable").model_dump() | {"mass_kg": mass_kg}
    plant = Plant(Airframe.model_validate(data), Scene(), seed=1, keeps_path=False)
    plant.place((0.0, 0.0, -2.0), (0.0, 0.0, 0.0))
    setpoint = TrajectorySetpoint(position_ned_m=(0.0, 0.0, -2.0), yaw_rad=0.0)
    seconds = round(1e6 / plant.interval_us)
    fractions = [plant.step(setpoint, armed=True).thrust_fraction for _ in range((SETTLING_S + HOVER_S) * seconds)]
    return float(np.mean(fractions[SETTLING_S * seconds :]))


def flights(seeds: int) -> list[StudyFlight]:
    off = {"lateral": {"threshold_m_s2": NEVER_M_S2}}
    return [
        StudyFlight(("bouncing", "off"), approach(BOUNCING_M_S, companion=off), "foldable", 1, is_drawn=True),
        StudyFlight(("bouncing", "on"), approach(BOUNCING_M_S), "foldable", 1, is_drawn=True),
    ]


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    off, on = results
    pulses = {name: [pulse(name, speed) for speed in PULSE_SPEEDS_M_S] for name in ("foldable", "rigid")}
    rows = (
        *_contact_rows(pulses["foldable"], pulses["rigid"]),
        *_force_rows(pulses["foldable"]),
        *_frame_rows(),
        at_least(
            "recovery off: hits on the wall",
            "keeps running into it like a bouncing ball",
            3.0,
            len(off.contacts),
            "hits",
            f"{len(on.contacts)} with recovery on; 1 m/s, detector's threshold out of reach",
        ),
    )
    pictures = {"pulse.png": _pulse_figure(pulses), "bouncing.png": _bouncing_figure(off, on)}
    return StudyFindings("Other claims", rows, pictures, _tables(pulses))


def _contact_rows(foldable: Sequence[Pulse], rigid: Sequence[Pulse]) -> tuple[ClaimRow, ...]:
    return (
        within_factor(
            "foldable: contact as an accelerometer's pulse, 1 m/s",
            "≈ 0.025 s",
            FOLDABLE_PULSE_S,
            foldable[0].width_s,
            "s",
            PULSE_FACTOR,
            f"deceleration above half of its peak; the whole contact is {foldable[0].contact_s:.3f} s",
        ),
        around(
            "foldable: the same beside eq. 2 in closed form",
            "not stated",
            HALF_FORCE_S,
            foldable[0].width_s,
            "s",
            0.03,
            f"b_s l' + k_s l has fallen to half after {1e3 * HALF_FORCE_S:.1f} ms",
        ),
        within_factor(
            "rigid: pulse, 1 m/s",
            "≈ 0.001 s",
            RIGID_PULSE_S,
            rigid[0].width_s,
            "s",
            PULSE_FACTOR,
            f"the whole contact is {1e3 * rigid[0].contact_s:.2f} ms",
        ),
    )


def _force_rows(foldable: Sequence[Pulse]) -> tuple[ClaimRow, ...]:
    fastest = foldable[-1]
    airframe = load_built_in("foldable")
    least_n = airframe.mass_kg * SPEED_CHANGE_M_S**2 / (2 * airframe.arms.fold_max_m)
    arithmetic_n = MASS_KG * SPEED_CHANGE_M_S / STOPPING_TIME_S
    return (
        around("m Δv / Δt for 1 kg, 5 m/s, 0.05 s", "100 N", FORCE_N, arithmetic_n, "N", 0.01, "a mean, not a peak"),
        around(
            "foldable: peak force at 5 m/s",
            "100 N",
            FORCE_N,
            fastest.peak_force_n,
            "N",
            0.45,
            f"stopping 1.112 kg from 5 m/s within l_max needs at least m v² / (2 · 0.03 m) = {least_n:.0f} N, and "
            "takes 0.012 s, not 0.05 s; the paper does not say how stiff its stop is",
        ),
        at_least(
            "factor of safety at 5 m/s, 185 N over the peak",
            "1.85 at 100 N",
            1.0,
            BREAKING_FORCE_N / fastest.peak_force_n,
            "",
            "185 N / 463 N = 0.40 with an ideal stop",
        ),
    )


def _frame_rows() -> tuple[ClaimRow, ...]:
    airframe = load_built_in("foldable")
    open_m = 2 * airframe.geometry.motor_radius_m
    folded_m = open_m - 2 * airframe.arms.fold_max_m
    paper_kg = airframe.mass_kg
    return (
        around("motor to motor, arms out", "≈ 290 mm", 1e3 * OPEN_M, 1e3 * open_m, "mm", 0.01),
        around("motor to motor, both arms folded", "≈ 230 mm", 1e3 * FOLDED_M, 1e3 * folded_m, "mm", 0.01),
        around("reduction", "20 %", 20.0, 100 * (1 - folded_m / open_m), "%", 0.05, "60 / 290 = 20.7 %"),
        at_most(
            "hover thrust at 1 kg", "below 70 %", 100 * HOVER_SHARE + 0.3, 100 * hover_share(1.0), "%", "in a hover"
        ),
        at_most(
            f"hover thrust at {paper_kg:g} kg",
            "below 70 %",
            100 * HOVER_SHARE + 0.3,
            100 * hover_share(paper_kg),
            "%",
            f"the paper allows 1 kg and flies {paper_kg:g} kg: 70 % · {paper_kg:g} = {70 * paper_kg:.1f} %",
        ),
    )


def _tables(pulses: dict[str, list[Pulse]]) -> dict[str, str]:
    """The pulse: how long an accelerometer's deceleration is above half of its peak. The contact: force above zero."""
    rows = [
        {
            "airframe": name,
            "m/s": f"{each.speed_m_s:g}",
            "pulse at half of its peak [ms]": f"{1e3 * each.width_s:.2f}",
            "whole contact [ms]": f"{1e3 * each.contact_s:.2f}",
            "peak force [N]": f"{each.peak_force_n:.0f}",
            "factor of safety": safety_text(each.peak_force_n),
        }
        for name, of_airframe in pulses.items()
        for each in of_airframe
    ]
    return {"Single head-on hits, motors off": table(rows)}


def _pulse_figure(pulses: dict[str, list[Pulse]]) -> Figure:
    figure, axes = new_figure(1, 2, "What an accelerometer feels of a head-on hit (8 kHz, not clipped)", width=6.0)
    drawn = zip(axes[0], pulses.items(), (120.0, 3.0), (FOLDABLE_PULSE_S, RIGID_PULSE_S), strict=True)
    for axis, (name, of_airframe), shown_ms, paper_s in drawn:
        for each in of_airframe[:-1]:
            label = f"{each.speed_m_s:g} m/s: {1e3 * each.width_s:.2g} ms above half of the peak"
            axis.plot(1e3 * each.time_s, each.deceleration_m_s2, label=label)
        axis.set_xlim(-0.1 * shown_ms, shown_ms)
        axis.axvline(0.0, color="0.35", linewidth=1.0)
        mark_paper(axis, 1e3 * paper_s, f"paper: over after ≈ {1e3 * paper_s:g} ms", is_time=True)
        finish(axis, name, "deceleration [m/s²]", "time since the first contact [ms]")
        axis.legend(fontsize=8, loc="center right")
    axes[0, 0].set_yscale("symlog", linthresh=50.0)
    return figure


def _bouncing_figure(off: StudyResult, on: StudyResult) -> Figure:
    figure, axes = new_figure(2, 2, "The same wall at 1 m/s without and with recovery (foldable)")
    for column, (result, title) in enumerate(((off, "recovery off"), (on, "recovery on"))):
        assert result.track is not None, "the wall is hit"
        draw_position(axes[0, column], result.track, title)
        draw_velocity(axes[1, column], result.track, "")
    add_legend(figure, axes)
    return figure
