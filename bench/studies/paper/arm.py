"""Parameter identification: the arm's response by eq. 2, in closed form and in the simulated vehicle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.fly.cruise import AFTER_S, HeadOnHit, head_on
from bench.rows.tables import table
from bench.studies.paper.figures import CONTACT, finish, mark_paper, new_figure
from bench.studies.paper.flights import Floats, StudyFlight, StudyResult
from bench.studies.paper.study import StudyFindings, around
from sim_vehicle.airframe import load_built_in

# The paper, section IV.
DAMPING_PER_S, STIFFNESS_PER_S2, FOLD_MAX_M = 30.0, 500.0, 0.03
IMPACT_M_S, REBOUND_M_S = 1.4, 0.28


@dataclass(frozen=True, slots=True)
class SpringResponse:
    """Eq. 2, l'' = -b_s l' - k_s l from l = 0 with l' = v: the wall stops a vehicle that lands on its arms."""

    damping_per_s: float
    stiffness_per_s2: float
    speed_m_s: float

    @property
    def _decay_per_s(self) -> float:
        return self.damping_per_s / 2.0

    @property
    def _frequency_rad_s(self) -> float:
        return math.sqrt(self.stiffness_per_s2 - self._decay_per_s**2)

    @property
    def half_period_s(self) -> float:
        """When l is back at zero, the paper's end of the contact."""
        return math.pi / self._frequency_rad_s

    @property
    def peak_s(self) -> float:
        return math.atan2(self._frequency_rad_s, self._decay_per_s) / self._frequency_rad_s

    @property
    def force_free_s(self) -> float:
        """When b_s l' + k_s l is back at zero: from here on the wall would have to pull."""
        return 2.0 * self.peak_s

    def fold_m(self, time_s: Floats) -> Floats:
        phase = self._frequency_rad_s * time_s
        fold: Floats = self.speed_m_s / self._frequency_rad_s * np.exp(-self._decay_per_s * time_s) * np.sin(phase)
        return fold

    def rate_m_s(self, time_s: Floats) -> Floats:
        phase = self._frequency_rad_s * time_s
        ratio = self._decay_per_s / self._frequency_rad_s
        rate: Floats = self.speed_m_s * np.exp(-self._decay_per_s * time_s) * (np.cos(phase) - ratio * np.sin(phase))
        return rate

    def at(self, time_s: float) -> tuple[float, float]:
        """Fold (m) and its rate (m/s)."""
        return float(self.fold_m(np.array(time_s))), float(self.rate_m_s(np.array(time_s)))


def flights(seeds: int) -> list[StudyFlight]:
    """Nothing flies: a single hit is enough."""
    return []


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    airframe = load_built_in("foldable")
    arms = airframe.arms
    ours = SpringResponse(arms.damping_per_s, arms.stiffness_per_s2, IMPACT_M_S)
    papers = SpringResponse(DAMPING_PER_S, STIFFNESS_PER_S2, IMPACT_M_S)
    single = head_on(airframe, IMPACT_M_S)
    peak_m, _ = papers.at(papers.peak_s)
    _, free_m_s = papers.at(papers.force_free_s)
    rows = (
        around("damping b_s", "30 1/s", DAMPING_PER_S, arms.damping_per_s, "1/s", 0.01),
        around("stiffness k_s", "500 1/s²", STIFFNESS_PER_S2, arms.stiffness_per_s2, "1/s²", 0.01),
        around("largest fold l_max", "0.03 m", FOLD_MAX_M, arms.fold_max_m, "m", 0.01),
        around(
            "peak fold at 1.4 m/s, before the stop",
            f"{peak_m:.4f} m by eq. 2",
            peak_m,
            single.hit.max_fold_m,
            "m",
            0.005,
        ),
        around(
            "speed back of that hit, over the speed before",
            f"{-free_m_s / IMPACT_M_S:.3f} by eq. 2 until its force is zero",
            -free_m_s / IMPACT_M_S,
            single.hit.rebound_speed_m_s / IMPACT_M_S,
            "",
            0.02,
            "a single hit, motors off",
        ),
        around(
            "contact of that hit",
            f"{papers.force_free_s:.3f} s by eq. 2 until its force is zero",
            papers.force_free_s,
            single.hit.contact_duration_s,
            "s",
            0.02,
        ),
    )
    return StudyFindings(
        "Parameter identification",
        rows,
        {"arm.png": _figure(single, arms)},
        {"Where the contact ends, by eq. 2 at 1.4 m/s": _ends(ours, arms.hysteresis_m)},
    )


def fold_when_leaving_at(response: SpringResponse, speed_m_s: float) -> float:
    """The fold at which the arm of eq. 2, past its fastest return, is left with this speed."""
    time_s = np.linspace(response.force_free_s, response.half_period_s, 20_001)
    reached = int(np.argmax(-response.rate_m_s(time_s) <= speed_m_s))
    return response.at(float(time_s[reached]))[0]


def _ends(response: SpringResponse, hysteresis_m: float) -> str:
    """The wall cannot pull: it lets go when the force is zero, while the arm is still folded."""
    time_s = np.linspace(response.peak_s, response.half_period_s, 20_001)
    held_s = float(time_s[int(np.argmax(response.fold_m(time_s) <= hysteresis_m))])
    ends_s = {
        "force zero (ours)": response.force_free_s,
        f"l = δl = {1e3 * hysteresis_m:g} mm": held_s,
        "l = 0, section III-B.1": response.half_period_s,
    }
    rows = [
        {"end of the contact": name, "after": f"{at_s:.3f} s", "speed back": f"{-response.at(at_s)[1]:.2f} m/s"}
        for name, at_s in ends_s.items()
    ]
    needed_mm = 1e3 * fold_when_leaving_at(response, REBOUND_M_S)
    stated = {
        "end of the contact": f"as the paper states it, l = {needed_mm:.0f} mm",
        "after": "",
        "speed back": "0.28 m/s",
    }
    return table([*rows, {"after": "", **stated}])


def _figure(single: HeadOnHit, arms: Any) -> Any:
    figure, axes = new_figure(1, 1, "An arm folds and unfolds: head-on hit at 1.4 m/s", width=8.0, height=4.2)
    axis = axes[0, 0]
    response = SpringResponse(DAMPING_PER_S, STIFFNESS_PER_S2, IMPACT_M_S)
    time_s = np.linspace(0.0, response.half_period_s, 400)
    pushed = time_s <= response.force_free_s
    axis.plot(
        time_s[pushed],
        1e3 * response.fold_m(time_s[pushed]),
        color="tab:orange",
        linewidth=4,
        label="eq. 2, wall pushes",
    )
    axis.plot(
        time_s[~pushed],
        1e3 * response.fold_m(time_s[~pushed]),
        color="tab:orange",
        linestyle="--",
        label="eq. 2, wall would have to pull",
    )
    axis.plot(single.time_s, 1e3 * single.fold_m, color="tab:blue", marker=".", label="simulated arm")
    mark_paper(axis, 1e3 * FOLD_MAX_M, f"paper: l_max = {1e3 * FOLD_MAX_M:g} mm, the stop")
    axis.axhline(
        1e3 * arms.hysteresis_m, color="tab:green", linestyle=":", label=f"δl = {1e3 * arms.hysteresis_m:g} mm"
    )
    axis.axvline(0.0, color=CONTACT, linewidth=1.1, label="first contact")
    axis.axvline(single.hit.contact_duration_s, color=CONTACT, linewidth=1.1, linestyle="--", label="wall lets go")
    axis.set_xlim(-0.02, AFTER_S)
    axis.set_ylim(0.0, 34.0)
    finish(axis, "", "fold of the arm l [mm]")
    axis.legend(fontsize=8)
    return figure
