"""`rebound report`: the page of a flight."""

from argparse import Namespace
from pathlib import Path

from companion.shell.files import write_whole
from rebound_cli.flights.kept import flight_named, runs_folder
from rebound_cli.report.page import page
from rebound_cli.report.shown_flight import ShownFlight, recorded_flight
from rebound_cli.results.run_folder import REPORT_NAME


def run_report(options: Namespace) -> int:
    """Of a run's folder, into it where no other file is named. Raises ReboundError, OSError."""
    folder = flight_named(runs_folder(options.runs), options.flight).folder
    path = write_page(recorded_flight(folder), options.out or folder / REPORT_NAME, options.no_position)
    print(f"The report is in {path}")
    return 0


def write_page(flight: ShownFlight, path: Path, no_position: bool = False) -> Path:
    """Raises OSError."""
    write_whole(path, page(flight, no_position).encode())
    return path
