"""`rebound logs export`: one file of a flight."""

import io
from argparse import Namespace
from pathlib import Path

from companion.errors import ConfigurationError
from companion.shell.files import write_whole
from rebound_cli.flights.archive import add_flight, new_archive
from rebound_cli.flights.kept import flight_named, runs_folder
from rebound_cli.results.run_folder import TLOG_NAME


def run_export(options: Namespace) -> int:
    """Raises FlightError, RunFolderError, LogError."""
    flight, kind = flight_named(runs_folder(options.runs), options.flight), options.format
    out = options.out or Path(f"{flight.name}.{'tar.gz' if kind == 'archive' else kind}")
    if kind == "mcap":
        if options.no_position:
            raise ConfigurationError("a .mcap is little else than places: --no-position goes with the archive alone.")
        write_whole(out, _mcap(flight.folder))
    else:
        with new_archive(out, options.no_position) as archive:
            add_flight(archive, flight, "")
    print(f"{flight.name} is in {out}")
    return 0


def _mcap(folder: Path) -> bytes:
    """A run's folder as .mcap. A drone has no mcap, and need not have."""
    from rebound_cli.export.foxglove import write_mcap
    from rebound_cli.logs.reader import read_telemetry
    from rebound_cli.report.shown_flight import recorded_flight

    content = io.BytesIO()
    write_mcap(recorded_flight(folder), read_telemetry(folder / TLOG_NAME), content)
    return content.getvalue()
