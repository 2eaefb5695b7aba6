"""Single hits: the arm by eq. 2, and the paper's other claims: contact time, force, size, hover, no recovery."""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.rows.paper import BREAKING_FORCE_N, Floats, StudyFlight
from bench.rows.tables import table
from bench.studies.paper.figures import CONTACT, finish, mark_paper, new_figure
from bench.studies.paper.study import Findings, Study, claim
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

# The paper, section IV.
DAMPING_PER_S, STIFFNESS_PER_S2, FOLD_MAX_M = 30.0, 500.0, 0.03
IMPACT_M_S = 1.4


# Eq. 2, l'' = -b_s l' - k_s l from l = 0 with l' = v: the wall stops a vehicle that lands on its arms.
_DECAY_PER_S = DAMPING_PER_S / 2.0
_FREQUENCY_RAD_S = math.sqrt(STIFFNESS_PER_S2 - _DECAY_PER_S**2)
PEAK_S = math.atan2(_FREQUENCY_RAD_S, _DECAY_PER_S) / _FREQUENCY_RAD_S
# When b_s l' + k_s l is back at zero: from here on the wall would have to pull.
FORCE_FREE_S = 2.0 * PEAK_S
# When l is back at zero, the paper's end of the contact.
HALF_PERIOD_S = math.pi / _FREQUENCY_RAD_S


def spring_response(time_s: float | Floats) -> tuple[Floats, Floats]:
    """Its fold (m) and the fold's rate (m/s)."""
    phase, left = _FREQUENCY_RAD_S * np.asarray(time_s), IMPACT_M_S * np.exp(-_DECAY_PER_S * time_s)
    turn = np.sin(phase) / _FREQUENCY_RAD_S
    return left * turn, left * (np.cos(phase) - _DECAY_PER_S * turn)


# The wall is far above the ground and met at once, so that the fall counts for nothing.
THROWN_M, GAP_M, AFTER_S = 5.0, 0.02, 0.35


@dataclass(frozen=True, slots=True)
class HeadOnHit:
    """What eq. 2 and the stop of the arms alone make of a hit, without drag and friction."""

    hit: Hit
    time_s: Floats
    """Since the first touch."""
    fold_m: Floats
    """Of the arm that folds the most."""
    speed_m_s: Floats
    """Into the wall."""


def head_on(airframe: Airframe, speed_m_s: float) -> HeadOnHit:
    """Throw the vehicle at a wall and follow it for `AFTER_S`. Without friction, as the falling vehicle would turn."""
    data = airframe.model_dump()
    data["drag_n_s_m"] = 0.0
    data["surface"]["guard_friction"] = 0.0
    wall = {"point_ned_m": [0, 0, -THROWN_M], "normal_ned": [-1, 0, 0]}
    plant = Plant(Airframe.model_validate(data), Scene.model_validate({"walls": [wall]}), seed=1)
    geometry = airframe.geometry
    touch_m = geometry.motor_radius_m / math.sqrt(2.0) + geometry.guard_radius_m
    plant.place((-touch_m - GAP_M, 0.0, -THROWN_M), (speed_m_s, 0.0, 0.0))
    for _ in range(round((GAP_M / speed_m_s + AFTER_S) * 1e6 / plant.interval_us)):
        plant.step(None, armed=False)
    hit, series = plant.truth.hits[0], plant.truth.series()
    time_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    return HeadOnHit(hit, time_s, series["arm_fold_m"].max(axis=1), series["velocity_ned_m_s"][:, 0])


def _of_arm(flights: pd.DataFrame) -> Findings:
    airframe = load_built_in("foldable")
    arms, single = airframe.arms, head_on(airframe, IMPACT_M_S)
    peak_m, _ = spring_response(PEAK_S)
    _, free_m_s = spring_response(FORCE_FREE_S)
    rows = (
        claim("damping", arms.damping_per_s),
        claim("stiffness", arms.stiffness_per_s2),
        claim("fold", arms.fold_max_m),
        claim("peak fold", single.hit.max_fold_m, float(peak_m)),
        claim("speed back", single.hit.rebound_speed_m_s / IMPACT_M_S, -float(free_m_s) / IMPACT_M_S),
        claim("contact", single.hit.contact_duration_s, FORCE_FREE_S),
    )
    return Findings(rows, {"arm.png": _arm_figure(single, 1e3 * arms.hysteresis_m)})


def _arm_figure(single: HeadOnHit, rests_mm: float) -> Figure:
    figure, axes = new_figure(1, 1, "An arm folds and unfolds: head-on hit at 1.4 m/s", width=8.0, height=4.2)
    axis = axes[0, 0]
    time_s = np.linspace(0.0, HALF_PERIOD_S, 400)
    fold_mm, pushed = 1e3 * spring_response(time_s)[0], time_s <= FORCE_FREE_S
    pulls = {"linestyle": "--", "label": "eq. 2, wall would have to pull"}
    axis.plot(time_s[pushed], fold_mm[pushed], color="tab:orange", linewidth=4, label="eq. 2, wall pushes")
    axis.plot(time_s[~pushed], fold_mm[~pushed], color="tab:orange", **pulls)
    axis.plot(single.time_s, 1e3 * single.fold_m, color="tab:blue", marker=".", label="simulated arm")
    mark_paper(axis, 1e3 * FOLD_MAX_M, f"paper: l_max = {1e3 * FOLD_MAX_M:g} mm, the stop")
    axis.axhline(rests_mm, color="tab:green", linestyle=":", label=f"δl = {rests_mm:g} mm")
    axis.axvline(0.0, color=CONTACT, linewidth=1.1, label="first contact")
    axis.axvline(single.hit.contact_duration_s, color=CONTACT, linewidth=1.1, linestyle="--", label="wall lets go")
    axis.set_ylim(0.0, 34.0)
    finish(axis, "", "fold of the arm l [mm]", (-0.02, AFTER_S))
    axis.legend(fontsize=8)
    return figure


ARM = Study("Parameter identification", list, _of_arm)


# --- the other claims

# The paper, sections II and V.
MASS_KG, SPEED_CHANGE_M_S, STOPPING_TIME_S = 1.0, 5.0, 0.05
PULSE_SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5, 5.0)
# Never reached: the accelerometer's range is 157 m/s^2.
NEVER_M_S2 = 1.0e6
BOUNCING_M_S = 1.0
# The vehicle is let go with its motors at rest: it falls, climbs back, and its integral unwinds.
SETTLING_S, HOVER_S = 10, 10


def pulse(name: str, speed_m_s: float) -> dict[str, float]:
    """A single head-on hit with motors off, as an accelerometer read at 8 kHz without noise or clipping would show it.

    `width_s`: how long the deceleration is above half of its greatest; `contact_s`: how long there is a force.
    """
    data = load_built_in(name).model_dump()
    raw_us = data["imu"]["raw_interval_us"]
    quiet = {key: 0.0 for key in data["imu"] if key.endswith(("noise_m_s2", "bias_m_s2", "noise_rad_s", "bias_rad_s"))}
    data["imu"] |= quiet | {"integration_interval_us": raw_us, "accelerometer_range_m_s2": NEVER_M_S2}
    single = head_on(Airframe.model_validate(data), speed_m_s)
    deceleration = -np.gradient(single.speed_m_s, single.time_s)
    width_s = float(single.time_s[1] - single.time_s[0]) * np.count_nonzero(deceleration > 0.5 * deceleration.max())
    return {"width_s": width_s, "contact_s": single.hit.contact_duration_s, "peak_n": single.hit.peak_force_n}


def hover_share(mass_kg: float) -> float:
    """Thrust commanded in a hover over the greatest: mean over HOVER_S of a hover that has settled."""
    data = load_built_in("foldable").model_dump() | {"mass_kg": mass_kg}
    plant = Plant(Airframe.model_validate(data), Scene(), seed=1, keeps_path=False)
    plant.place((0.0, 0.0, -2.0), (0.0, 0.0, 0.0))
    setpoint = TrajectorySetpoint(position_ned_m=(0.0, 0.0, -2.0), yaw_rad=0.0)
    seconds = round(1e6 / plant.interval_us)
    fractions = [plant.step(setpoint, armed=True).thrust_fraction for _ in range((SETTLING_S + HOVER_S) * seconds)]
    return float(np.mean(fractions[SETTLING_S * seconds :]))


def _flights() -> list[StudyFlight]:
    off = {"lateral": {"threshold_m_s2": NEVER_M_S2}}
    missions = approach(BOUNCING_M_S, companion=off), approach(BOUNCING_M_S)
    return [StudyFlight({}, mission, "foldable", 1) for mission in missions]


def _conclude(flights: pd.DataFrame) -> Findings:
    pulses = {(name, speed): pulse(name, speed) for name in AIRFRAMES for speed in PULSE_SPEEDS_M_S}
    foldable, rigid, fastest_n = pulses["foldable", 1.0], pulses["rigid", 1.0], pulses["foldable", 5.0]["peak_n"]
    airframe = load_built_in("foldable")
    paper_kg, fold_m, open_m = airframe.mass_kg, airframe.arms.fold_max_m, 2 * airframe.geometry.motor_radius_m
    least_n, folded_m = paper_kg * SPEED_CHANGE_M_S**2 / (2 * fold_m), open_m - 2 * fold_m
    off_hits, on_hits = flights["hits"]
    rows = (
        claim("foldable pulse", foldable["width_s"], contact=foldable["contact_s"]),
        claim("closed form", foldable["width_s"]),
        claim("rigid pulse", rigid["width_s"], contact_ms=1e3 * rigid["contact_s"]),
        claim("mean force", MASS_KG * SPEED_CHANGE_M_S / STOPPING_TIME_S),
        claim("peak force", fastest_n, least=least_n),
        claim("safety", BREAKING_FORCE_N / fastest_n),
        claim("open", 1e3 * open_m),
        claim("folded", 1e3 * folded_m),
        claim("reduction", 100 * (1 - folded_m / open_m)),
        claim("hover", 100 * hover_share(MASS_KG)),
        claim("own hover", 100 * hover_share(paper_kg), mass=paper_kg, scaled=70 * paper_kg),
        claim("bouncing", off_hits, on=on_hits),
    )
    lines = [
        {
            "airframe": name,
            "m/s": f"{speed_m_s:g}",
            "pulse at half of its peak [ms]": f"{1e3 * each['width_s']:.2f}",
            "whole contact [ms]": f"{1e3 * each['contact_s']:.2f}",
            "peak force [N]": f"{each['peak_n']:.0f}",
            "factor of safety": f"{BREAKING_FORCE_N / each['peak_n']:.2f}",
        }
        for (name, speed_m_s), each in pulses.items()
    ]
    return Findings(rows, tables={"Single head-on hits, motors off": table(lines)})


OTHERS = Study("Other claims", _flights, _conclude)
