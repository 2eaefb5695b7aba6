"""`rebound identify`: from hits in recorded data to an airframe file."""

from argparse import Namespace
from pathlib import Path

from rebound_cli import run_folder
from rebound_cli.documents import load_document, parse_document, validated
from rebound_cli.identification.capture import find_hit, read_table
from rebound_cli.identification.flight import flight_hit
from rebound_cli.identification.hit import Hit, IdentificationError
from rebound_cli.identification.report import airframe_text, identify, report_text
from sim_vehicle.airframe import Airframe, load_built_in, with_base


def run_identify(options: Namespace) -> int:
    """Print what the hits show and, with --out, write it as an airframe file. Raises IdentificationError."""
    out: Path | None = options.out
    if out is not None and out.exists():
        raise IdentificationError(f"{out} exists already: give --out another name.")
    found = identify([_hit(path, {"x": 0, "y": 1}.get(options.axis)) for path in options.data])
    mass_kg = _mass_kg(options)
    print(report_text(found, mass_kg), end="")
    if out is None:
        return 0
    if mass_kg is None:
        raise IdentificationError("the data do not say how heavy the vehicle is: give --mass KG.")
    base_name = options.based_on or ("foldable" if found.spring is not None else "rigid")
    text = airframe_text(found, options.name or out.stem, mass_kg, base_name, load_built_in(base_name))
    # The file is read as `--airframe` will read it before anybody finds it on the disk.
    document = parse_document(text, str(out))
    validated(Airframe, document, with_base(document.data))
    out.write_text(text, encoding="utf-8")
    print(f"\nWritten to {out}. Fly it: rebound fly missions/wall.yaml --lockstep --airframe {out}")
    return 0


def _hit(path: Path, axis: int | None) -> Hit:
    if path.is_dir():
        path = path / run_folder.TLOG_NAME
        if not path.exists():
            text = f"no {run_folder.TLOG_NAME} in this folder; give a run's folder or a file"
            raise IdentificationError(f"{path.parent}: {text}.")
    return flight_hit(path) if path.suffix == ".tlog" else find_hit(read_table(path), axis)


def _mass_kg(options: Namespace) -> float | None:
    """As given, or that of the simulated vehicle that flew the runs."""
    if options.mass is not None:
        return float(options.mass)
    stored = next((file for path in options.data if (file := path / run_folder.AIRFRAME_NAME).is_file()), None)
    mass_kg = None if stored is None else load_document(stored).data.get("mass_kg")
    return float(mass_kg) if isinstance(mass_kg, int | float) else None
