"""`rebound logs export`: one file of a flight."""

import io
import tarfile
from argparse import Namespace
from pathlib import Path

from companion.shell.files import write_whole
from rebound_cli.flights.kept import KeptFlight, flight_named, runs_folder
from rebound_cli.inputs.documents import refuse_special
from rebound_cli.results.run_folder import TLOG_NAME


def run_export(options: Namespace) -> None:
    """Raises RunFolderError, LogError."""
    flight, kind = flight_named(runs_folder(options.runs), options.flight), options.format
    out = options.out or Path(f"{flight.name}.{'tar.gz' if kind == 'archive' else kind}")
    refuse_special(out)
    if kind == "archive":
        _write_archive(out, flight)
    else:
        # A drone has no mcap, and need not have.
        from rebound_cli.export.foxglove import write_mcap
        from rebound_cli.logs.reader import read_telemetry
        from rebound_cli.report.shown_flight import recorded_flight

        content = io.BytesIO()
        write_mcap(recorded_flight(flight.folder), read_telemetry(flight.folder / TLOG_NAME), content)
        write_whole(out, content.getvalue())
    print(f"{flight.name} is in {out}")


def _write_archive(path: Path, flight: KeptFlight) -> None:
    """Whole or not at all; its files as long as they are now: the present flight goes on meanwhile."""
    unfinished = path.with_name(f"{path.name}.part")
    try:
        with tarfile.open(unfinished, "w:gz") as tar:
            for file in sorted(flight.folder.iterdir()):
                tar.add(file, f"{flight.name}/{file.name}", recursive=False)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
