"""Parameter identification: the arm's response by eq. 2, in closed form and in the simulated vehicle."""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bench.fly.cruise import AFTER_S, HeadOnHit, head_on
from bench.rows.paper import Floats
from bench.studies.paper.claims import claim
from bench.studies.paper.figures import CONTACT, finish, mark_paper, new_figure
from bench.studies.paper.study import Findings, Study
from sim_vehicle.airframe import load_built_in

# The paper, section IV.
DAMPING_PER_S, STIFFNESS_PER_S2, FOLD_MAX_M = 30.0, 500.0, 0.03
IMPACT_M_S = 1.4


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

    def at(self, time_s: float | Floats) -> tuple[Floats, Floats]:
        """Fold (m) and its rate (m/s)."""
        phase, left = self._frequency_rad_s * np.asarray(time_s), self.speed_m_s * np.exp(-self._decay_per_s * time_s)
        turn = np.sin(phase) / self._frequency_rad_s
        return left * turn, left * (np.cos(phase) - self._decay_per_s * turn)


PAPERS = SpringResponse(DAMPING_PER_S, STIFFNESS_PER_S2, IMPACT_M_S)


def _conclude(flights: pd.DataFrame) -> Findings:
    airframe = load_built_in("foldable")
    arms, single = airframe.arms, head_on(airframe, IMPACT_M_S)
    peak_m, _ = PAPERS.at(PAPERS.peak_s)
    _, free_m_s = PAPERS.at(PAPERS.force_free_s)
    rows = (
        claim("damping", arms.damping_per_s),
        claim("stiffness", arms.stiffness_per_s2),
        claim("fold", arms.fold_max_m),
        claim("peak fold", single.hit.max_fold_m, float(peak_m)),
        claim("speed back", single.hit.rebound_speed_m_s / IMPACT_M_S, -float(free_m_s) / IMPACT_M_S),
        claim("contact", single.hit.contact_duration_s, PAPERS.force_free_s),
    )
    return Findings(rows, {"arm.png": _figure(single, 1e3 * arms.hysteresis_m)})


def _figure(single: HeadOnHit, rests_mm: float) -> Figure:
    figure, axes = new_figure(1, 1, "An arm folds and unfolds: head-on hit at 1.4 m/s", width=8.0, height=4.2)
    axis = axes[0, 0]
    time_s = np.linspace(0.0, PAPERS.half_period_s, 400)
    fold_mm, pushed = 1e3 * PAPERS.at(time_s)[0], time_s <= PAPERS.force_free_s
    pulls = {"linestyle": "--", "label": "eq. 2, wall would have to pull"}
    axis.plot(time_s[pushed], fold_mm[pushed], color="tab:orange", linewidth=4, label="eq. 2, wall pushes")
    axis.plot(time_s[~pushed], fold_mm[~pushed], color="tab:orange", **pulls)
    axis.plot(single.time_s, 1e3 * single.fold_m, color="tab:blue", marker=".", label="simulated arm")
    mark_paper(axis, 1e3 * FOLD_MAX_M, f"paper: l_max = {1e3 * FOLD_MAX_M:g} mm, the stop")
    axis.axhline(rests_mm, color="tab:green", linestyle=":", label=f"δl = {rests_mm:g} mm")
    axis.axvline(0.0, color=CONTACT, linewidth=1.1, label="first contact")
    axis.axvline(single.hit.contact_duration_s, color=CONTACT, linewidth=1.1, linestyle="--", label="wall lets go")
    axis.set_xlim(-0.02, AFTER_S)
    axis.set_ylim(0.0, 34.0)
    finish(axis, "", "fold of the arm l [mm]")
    axis.legend(fontsize=8)
    return figure


ARM = Study("Parameter identification", lambda seeds: [], _conclude)
