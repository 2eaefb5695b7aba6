"""The paper's other claims: contact time, force and safety, size, hover, and what happens without recovery."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.fly.cruise import head_on
from bench.rows.tables import table
from bench.studies.paper.claims import claim
from bench.studies.paper.figures import add_legend, draw_position, draw_velocity, new_figure
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import StudyFindings, safety_text
from bench.studies.paper.track import Floats
from rebound_cli.results.summary import BREAKING_FORCE_N
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.setpoint import TrajectorySetpoint

# The paper, sections II and V.
MASS_KG, SPEED_CHANGE_M_S, STOPPING_TIME_S = 1.0, 5.0, 0.05
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
    pulses = {name: [pulse(name, speed) for speed in PULSE_SPEEDS_M_S] for name in AIRFRAMES}
    foldable, rigid, fastest_n = pulses["foldable"], pulses["rigid"], pulses["foldable"][-1].peak_force_n
    airframe = load_built_in("foldable")
    paper_kg, fold_m, open_m = airframe.mass_kg, airframe.arms.fold_max_m, 2 * airframe.geometry.motor_radius_m
    least_n, folded_m = paper_kg * SPEED_CHANGE_M_S**2 / (2 * fold_m), open_m - 2 * fold_m
    rows = (
        claim("foldable pulse", foldable[0].width_s, contact=foldable[0].contact_s),
        claim("closed form", foldable[0].width_s),
        claim("rigid pulse", rigid[0].width_s, contact_ms=1e3 * rigid[0].contact_s),
        claim("mean force", MASS_KG * SPEED_CHANGE_M_S / STOPPING_TIME_S),
        claim("peak force", fastest_n, least=least_n),
        claim("safety", BREAKING_FORCE_N / fastest_n),
        claim("open", 1e3 * open_m),
        claim("folded", 1e3 * folded_m),
        claim("reduction", 100 * (1 - folded_m / open_m)),
        claim("hover", 100 * hover_share(MASS_KG)),
        claim("own hover", 100 * hover_share(paper_kg), mass=paper_kg, scaled=70 * paper_kg),
        claim("bouncing", len(off.contacts), on=len(on.contacts)),
    )
    return StudyFindings("Other claims", rows, {"bouncing.png": _bouncing_figure(off, on)}, _tables(pulses))


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


def _bouncing_figure(off: StudyResult, on: StudyResult) -> Figure:
    figure, axes = new_figure(2, 2, "The same wall at 1 m/s without and with recovery (foldable)")
    for column, (result, title) in enumerate(((off, "recovery off"), (on, "recovery on"))):
        assert result.track is not None, "the wall is hit"
        draw_position(axes[0, column], result.track, title)
        draw_velocity(axes[1, column], result.track, "")
    add_legend(figure, axes)
    return figure
