"""`rebound logs export`: one file of a flight."""

from argparse import Namespace
from pathlib import Path

from companion.errors import ConfigurationError
from rebound_cli.flights.archive import add_flight, new_archive
from rebound_cli.flights.kept import flight_named, runs_folder


def run_export(options: Namespace) -> int:
    """Raises FlightError, RunFolderError, LogError."""
    flight, kind = flight_named(runs_folder(options.runs), options.flight), options.format
    out = options.out or Path(f"{flight.name}.{'tar.gz' if kind == 'archive' else kind}")
    if kind != "archive":
        if options.no_position:
            raise ConfigurationError(
                f"a .{kind} is little else than places: --no-position goes with the archive alone."
            )
        # A drone has neither mcap nor pyulog, and need not have.
        from rebound_cli.export.writer import write_flight

        write_flight(flight.folder, kind, out)
    else:
        with new_archive(out, options.no_position) as archive:
            add_flight(archive, flight, "")
    print(f"{flight.name} is in {out}")
    return 0
