"""`rebound identify`: from hits in recorded data to text for a person and an airframe file."""

import json
import math
from argparse import Namespace
from pathlib import Path

from rebound_cli.documents import load_document, parse_document, refuse_existing, validated, write_text
from rebound_cli.identification.fit import Identified, Number, Spring, identify
from rebound_cli.identification.hit import IdentificationError, flight_hit
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.recording import log_file
from rebound_cli.results import run_folder
from sim_vehicle.airframe import Airframe, load_built_in, with_base


def run_identify(options: Namespace) -> int:
    """Print what the hits show and, with --out, write it as an airframe file. Raises IdentificationError."""
    out: Path | None = options.out
    refuse_existing(out)
    found = identify([flight_hit(read_log(log_file(path))) for path in options.data])
    mass_kg = _mass_kg(options)
    print(report_text(found), end="")
    if out is None:
        return 0
    if mass_kg is None:
        raise IdentificationError("the data do not say how heavy the vehicle is: give --mass KG.")
    base_name = "foldable" if found.spring is not None else "rigid"
    text = airframe_text(found, out.stem, mass_kg, base_name, load_built_in(base_name))
    # The file is read as `--airframe` will read it before anybody finds it on the disk.
    document = parse_document(text, str(out))
    validated(Airframe, document, with_base(document.data))
    write_text(out, text)
    print(f"\nWritten to {out}. Fly it: rebound fly missions/wall.yaml --lockstep --airframe {out}")
    return 0


def _mass_kg(options: Namespace) -> float | None:
    """As given, or that of the simulated vehicle that flew the runs."""
    if options.mass is not None:
        return float(options.mass)
    stored = next((file for path in options.data if (file := path / run_folder.AIRFRAME_NAME).is_file()), None)
    mass_kg = None if stored is None else load_document(stored).data.get("mass_kg")
    return float(mass_kg) if isinstance(mass_kg, int | float) else None


def report_text(found: Identified) -> str:
    """Markdown: the hits and the numbers."""
    rows = [
        f"{hit.name} | {hit.at_s:.2f} s | {hit.guards} | {hit.speed_in_m_s:.3f} m/s | {hit.speed_out_m_s:.3f} ± "
        f"{hit.speed_sigma_m_s:.3f} m/s | {hit.ratio:.2f}"
        for hit in found.hits
    ]
    head = "hit | at | guards | in | out | ratio"
    table = [f"| {head} |", "|" + "---|" * (head.count("|") + 1), *(f"| {row} |" for row in rows), ""]
    return "\n".join([*table, *_numbers(found)]) + "\n"


def _numbers(found: Identified) -> list[str]:
    lines = [f"- restitution {_text(found.restitution, 3)}"]
    if found.spring is None:
        lines.append("- spring: not shown; every contact is over within the time between a few samples")
    else:
        spring = found.spring
        lines.append(
            f"- spring: k_s = {_text(spring.stiffness_per_s2, 0)} 1/s2, b_s = {_text(spring.damping_per_s, 1)} 1/s, "
            f"from {spring.hits} of {len(found.hits)} hits; contact {1e3 * spring.contact_time_s():.0f} ms head-on, "
            f"pressed {1e3 * found.deepest_m:.0f} mm at most"
        )
    if found.stop_m is not None:
        lines.append(f"- stop of the arms met after {1e3 * found.stop_m:.0f} mm")
    return lines


def _text(number: Number, digits: int) -> str:
    return f"{number.value:.{digits}f} ± {number.sigma:.{digits}f}"


def airframe_text(found: Identified, name: str, mass_kg: float, base_name: str, base: Airframe) -> str:
    """An airframe file that states what was identified and takes the rest from ``base``."""
    scale = mass_kg / base.mass_kg
    inertia = ", ".join(f"{scale * value:.5g}" for value in base.inertia_kg_m2)
    description = f"Contact identified from {', '.join(hit.name for hit in found.hits)}"
    return f"""\
# Number of hits: {len(found.hits)}. Made by `rebound identify`; ± is one standard deviation.
based_on: {base_name}
name: {_quoted(name)}
description: {_quoted(description)}

mass_kg: {mass_kg:g}
# Not identified: those of {base_name}, in proportion to the mass.
inertia_kg_m2: [{inertia}]
motors: {{max_thrust_n: {scale * base.motors.max_thrust_n:.4g}}}

arms:
{_rigid(found) if found.spring is None else _sprung(found, found.spring, base_name, base)}
"""


def _quoted(text: str) -> str:
    """As YAML takes it, whatever is in it: names are those of files."""
    return json.dumps(text, ensure_ascii=False)


def _sprung(found: Identified, spring: Spring, base_name: str, base: Airframe) -> str:
    stiffness, damping = spring.stiffness_per_s2, spring.damping_per_s
    fold_m, why = found.stop_m, "where the push rose again"
    if fold_m is None:
        seen_m = math.ceil(1e3 * found.deepest_m) / 1e3
        fold_m = max(seen_m, base.arms.fold_max_m)
        borrowed = f": that of {base_name}" if fold_m > seen_m else ""
        why = f"no stop was met within {1e3 * found.deepest_m:.0f} mm{borrowed}"
    return f"""\
  stiffness_per_s2: {stiffness.value:.5g}   # ± {stiffness.sigma:.2g}
  damping_per_s: {damping.value:.4g}   # ± {damping.sigma:.2g}
  fold_max_m: {fold_m:.3g}   # {why}
  # A stop's own contact is not identified."""


def _rigid(found: Identified) -> str:
    # The model of an airframe's contact ends just below 1 and above 0.
    number = found.restitution
    return f"""\
  fold_max_m: 0.0   # the contact is too short for the data to show a spring
  stop: {{restitution: {min(max(number.value, 0.01), 0.99):.3f}}}   # ± {number.sigma:.3f}"""
