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
    if kind != "archive":
        if options.no_position:
            raise ConfigurationError(
                f"a .{kind} is little else than places: --no-position goes with the archive alone."
            )
        write_whole(out, _exported(flight.folder, kind))
    else:
        with new_archive(out, options.no_position) as archive:
            add_flight(archive, flight, "")
    print(f"{flight.name} is in {out}")
    return 0


def _exported(folder: Path, kind: str) -> bytes:
    """A run's folder as .mcap or .ulg. A drone has neither mcap nor pyulog, and need not have."""
    from rebound_cli.logs.reader import read_telemetry
    from rebound_cli.report.shown_flight import recorded_flight

    flight, log = recorded_flight(folder), read_telemetry(folder / TLOG_NAME)
    if kind == "mcap":
        from rebound_cli.export.foxglove import write_mcap

        content = io.BytesIO()
        write_mcap(flight, log, content)
        return content.getvalue()
    from rebound_cli.export.ulog import new_ulog

    return new_ulog(flight, log)
