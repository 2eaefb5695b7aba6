"""`rebound identify`: from hits in recorded data to text for a person and an airframe file."""

import json
import math
from argparse import Namespace
from pathlib import Path

from rebound_cli.documents import load_document, parse_document, refuse_existing, validated, write_text
from rebound_cli.identification.fit import Identified, Spring, identify
from rebound_cli.identification.hit import IdentificationError, flight_hit
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.recording import log_file
from rebound_cli.results import run_folder
from sim_vehicle.airframe import Airframe, load_built_in, with_base


def run_identify(options: Namespace) -> int:
    """Print the hits and the airframe that they show; with --out write it. Raises IdentificationError."""
    out: Path | None = options.out
    refuse_existing(out)
    found = identify([flight_hit(read_log(log_file(path))) for path in options.data])
    mass_kg = _mass_kg(options)
    if mass_kg is None:
        raise IdentificationError("the data do not say how heavy the vehicle is: give --mass KG.")
    for hit in found.hits:
        speeds = f"{hit.speed_in_m_s:.3f} m/s in, {hit.speed_out_m_s:.3f} ± {hit.speed_sigma_m_s:.3f} m/s out"
        print(f"{hit.name} at {hit.at_s:.2f} s: {speeds}, on {hit.guards} guard{'s' if hit.guards > 1 else ''}")
    base_name = "foldable" if found.spring is not None else "rigid"
    name = "mine" if out is None else out.stem
    text = airframe_text(found, name, mass_kg, base_name, load_built_in(base_name))
    # Read as `--airframe` will read it before anybody has it.
    document = parse_document(text, str(out or "the airframe"))
    validated(Airframe, document, with_base(document.data))
    print(f"\n{text}", end="")
    if out is not None:
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
