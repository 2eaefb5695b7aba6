"""What was found, as text for a person and as the airframe file."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from rebound_cli.identification.fit import (
    FEWEST_FOR_LOSS,
    Number,
    Rebound,
    Spring,
    fit_friction,
    fit_restitution,
    fit_restitution_with_loss,
    fit_spring,
)
from rebound_cli.identification.hit import Hit
from rebound_cli.identification.model import deepest
from sim_vehicle.airframe import Airframe

# Leaving one hit out has to leave at least two.
FEWEST_FOR_LEAVE_ONE_OUT = 3


class Model(Protocol):
    def speed_out(self, hit: Hit) -> float: ...


@dataclass(frozen=True, slots=True)
class Identified:
    """Everything fitted to the hits; None where they do not show it."""

    hits: tuple[Hit, ...]
    restitution: Rebound
    with_loss: Rebound | None
    spring: Spring | None
    friction: Number | None

    @property
    def deepest_m(self) -> float:
        """The furthest that any of the hits pressed the spring."""
        if self.spring is None:
            return 0.0
        k, b = self.spring.stiffness_per_s2.value, self.spring.damping_per_s.value
        return max(deepest(hit.speed_in_m_s, k * hit.guards / 2, b * hit.guards / 2) for hit in self.hits)

    @property
    def stop_m(self) -> float | None:
        stops = sorted(hit.stop_m for hit in self.hits if hit.stop_m is not None)
        return stops[len(stops) // 2] if stops else None


def identify(hits: Sequence[Hit]) -> Identified:
    return Identified(
        hits=tuple(hits),
        restitution=fit_restitution(hits),
        with_loss=fit_restitution_with_loss(hits) if len(hits) >= FEWEST_FOR_LOSS else None,
        spring=fit_spring(hits),
        friction=fit_friction(hits),
    )


def leave_one_out(hits: Sequence[Hit]) -> dict[str, list[float | None]]:
    """Predicted minus measured speed out (m/s) of every hit, each model fitted to all the others."""
    errors: dict[str, list[float | None]] = {}
    for index, hit in enumerate(hits):
        for name, model in _models([*hits[:index], *hits[index + 1 :]]).items():
            errors.setdefault(name, []).append(None if model is None else model.speed_out(hit) - hit.speed_out_m_s)
    return {name: column for name, column in errors.items() if any(error is not None for error in column)}


def _models(hits: Sequence[Hit]) -> dict[str, Model | None]:
    found = identify(hits)
    return {"restitution": found.restitution, "restitution and loss": found.with_loss, "spring": found.spring}


def report_text(found: Identified, mass_kg: float | None) -> str:
    """Markdown: the hits, the force sensor, the numbers, the leave-one-out table."""
    lines = [
        "| hit | at | guards | in | out | ratio | along the wall, in and out |",
        "|---|---|---|---|---|---|---|",
    ]
    for hit in found.hits:
        speeds = f"{hit.speed_in_m_s:.3f} m/s | {hit.speed_out_m_s:.3f} ± {hit.speed_sigma_m_s:.3f} m/s"
        along = f"{hit.along_in_m_s:.2f}, {hit.along_out_m_s:.2f} m/s"
        lines.append(f"| {hit.name} | {hit.at_s:.2f} s | {hit.guards} | {speeds} | {hit.ratio:.2f} | {along} |")
    lines += ["", *_force_lines(found.hits, mass_kg), *_numbers(found), "", *_leave_one_out_lines(found.hits)]
    return "\n".join(lines) + "\n"


def _force_lines(hits: Sequence[Hit], mass_kg: float | None) -> list[str]:
    """The sensor beside the momentum: the fit does not use it, and here a reader sees whether it could."""
    if not any(hit.force for hit in hits):
        return []
    lines = ["| force sensor | peak | pull | impulse | mass times change of speed |", "|---|---|---|---|---|"]
    for hit in hits:
        if hit.force is not None:
            momentum = f"{mass_kg * hit.normal_change_m_s:.2f} N s" if mass_kg is not None else "give --mass"
            force = f"{hit.force.peak_n:.0f} N | {hit.force.pull_n:.0f} N | {hit.force.impulse_n_s:.2f} N s"
            lines.append(f"| {hit.name} | {force} | {momentum} |")
    return [*lines, ""]


def _numbers(found: Identified) -> list[str]:
    lines = [f"- restitution {_text(found.restitution.restitution, 3)}"]
    if found.with_loss is not None and found.with_loss.loss_m_s is not None:
        loss = _text(found.with_loss.loss_m_s, 3)
        lines.append(f"- restitution and loss: {_text(found.with_loss.restitution, 3)} of the speed, less {loss} m/s")
    if found.spring is None:
        lines.append("- spring: not shown; every contact is over within the time between a few samples")
    else:
        spring = found.spring
        lines.append(
            f"- spring: k_s = {_text(spring.stiffness_per_s2, 0)} 1/s2, b_s = {_text(spring.damping_per_s, 1)} 1/s, "
            f"from {spring.hits} of {len(found.hits)} hits; contact {1e3 * spring.contact_time_s:.0f} ms head-on, "
            f"pressed {1e3 * found.deepest_m:.0f} mm at most"
        )
    if found.stop_m is not None:
        lines.append(f"- stop of the arms met after {1e3 * found.stop_m:.0f} mm")
    if found.friction is not None:
        lines.append(f"- friction along the wall at least {_text(found.friction, 2)}")
    return lines


def _leave_one_out_lines(hits: Sequence[Hit]) -> list[str]:
    if len(hits) < FEWEST_FOR_LEAVE_ONE_OUT:
        count = "1 hit is" if len(hits) == 1 else f"{len(hits)} hits are"
        return [f"{count} too few to leave one out: nothing checks these numbers against another hit."]
    errors = leave_one_out(hits)
    lines = [
        "Speed out predicted from all the other hits, less the measured one:",
        "",
        "| hit | " + " | ".join(errors) + " |",
        "|---|" + "---|" * len(errors),
    ]
    for index, hit in enumerate(hits):
        lines.append(f"| {hit.name} | " + " | ".join(_error(column[index]) for column in errors.values()) + " |")
    for label, summary in (("mean of absolute errors", _mean), ("worst", max)):
        cells = []
        for column in errors.values():
            known = [abs(error) for error in column if error is not None]
            cells.append(f"{summary(known):.3f} m/s")
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return [*lines, "", f"{len(hits)} hits of one vehicle: a column of {len(hits)} errors is an example, no proof."]


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _error(error: float | None) -> str:
    return "-" if error is None else f"{error:+.3f} m/s"


def _text(number: Number, digits: int) -> str:
    return f"{number.value:.{digits}f} ± {number.sigma:.{digits}f}"


def airframe_text(found: Identified, name: str, mass_kg: float, base_name: str, base: Airframe) -> str:
    """An airframe file that states what was identified and takes the rest from ``base``."""
    scale = mass_kg / base.mass_kg
    inertia = ", ".join(f"{scale * value:.5g}" for value in base.inertia_kg_m2)
    hits = ", ".join(hit.name for hit in found.hits)
    lines = [
        f"# Number of hits: {len(found.hits)}. Made by `rebound identify`; ± is one standard deviation.",
        f"based_on: {base_name}",
        f"name: {_quoted(name)}",
        f"description: {_quoted(f'Contact identified from {hits}')}",
        "",
        f"mass_kg: {mass_kg:g}",
        f"# Not identified: those of {base_name}, in proportion to the mass.",
        f"inertia_kg_m2: [{inertia}]",
        f"motors: {{max_thrust_n: {scale * base.motors.max_thrust_n:.4g}}}",
        "",
        "arms:",
        *(_spring_lines(found, found.spring, base_name, base) if found.spring else _rigid_lines(found)),
    ]
    if found.friction is not None:
        lines += [
            "",
            f"surface: {{guard_friction: {found.friction.value:.3f}}}   # at least; ± {found.friction.sigma:.3f}",
        ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """As YAML takes it, whatever is in it: names are those of files."""
    return json.dumps(text, ensure_ascii=False)


def _spring_lines(found: Identified, spring: Spring, base_name: str, base: Airframe) -> list[str]:
    stiffness, damping = spring.stiffness_per_s2, spring.damping_per_s
    if found.stop_m is not None:
        fold_m, why = found.stop_m, "where the push rose again"
    else:
        seen_m = math.ceil(1e3 * found.deepest_m) / 1e3
        fold_m = max(seen_m, base.arms.fold_max_m)
        why = f"no stop was met within {1e3 * found.deepest_m:.0f} mm"
        why += f": that of {base_name}" if fold_m > seen_m else ""
    return [
        f"  stiffness_per_s2: {stiffness.value:.5g}   # ± {stiffness.sigma:.2g}",
        f"  damping_per_s: {damping.value:.4g}   # ± {damping.sigma:.2g}",
        f"  fold_max_m: {fold_m:.3g}   # {why}",
        "  # A stop's own contact is not identified.",
    ]


def _rigid_lines(found: Identified) -> list[str]:
    number = found.restitution.restitution
    # The model of an airframe's contact ends just below 1 and above 0.
    value = min(max(number.value, 0.01), 0.99)
    return [
        "  fold_max_m: 0.0   # the contact is too short for the data to show a spring",
        f"  stop: {{restitution: {value:.3f}}}   # ± {number.sigma:.3f}",
    ]
