"""`rebound report`: the page of a recorded flight."""

from argparse import Namespace

from rebound_cli.flights.kept import flight_named, runs_folder
from rebound_cli.report.writer import write_report


def run_report(options: Namespace) -> int:
    """Raises ReboundError."""
    folder = flight_named(runs_folder(options.runs), options.flight).folder
    path = write_report(folder, options.out, options.no_position)
    print(f"The report is in {path}")
    return 0
