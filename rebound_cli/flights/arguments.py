"""The arguments of `rebound logs` and `rebound doctor`."""

import argparse
from pathlib import Path

from rebound_cli.arguments import Commands, add_json, count, runs


def add_logs(commands: Commands) -> None:
    logs = commands.add_parser(
        "logs",
        help="recorded flights of real vehicles: list, show, export",
        description="Flights that `fly --connect` and `guard` have recorded; see docs/logs.md.",
    )
    whats = logs.add_subparsers(required=True, metavar="WHAT", dest="what")
    listed = whats.add_parser("list", help="every flight, the oldest first", description="Every flight.")
    shown = whats.add_parser("show", help="what happened in a flight", description="What happened in a flight.")
    exported = whats.add_parser("export", help="one archive of a flight", description="One archive of a flight.")
    for parser, function in ((listed, "run_list"), (shown, "run_show"), (exported, "run_export")):
        if parser is not listed:
            parser.add_argument(
                "flight", nargs="?", default="last", metavar="FLIGHT", help="its name or folder (default: last)"
            )
        _add_runs(parser)
        parser.set_defaults(run=runs(f"rebound_cli.flights.command:{function}"))
    add_json(listed, "flights")
    add_json(shown, "flight")
    exported.add_argument("--out", type=Path, metavar="FILE", help="the archive (default: FLIGHT.tar.gz)")
    _add_no_position(exported)


def add_doctor(commands: Commands) -> None:
    doctor = commands.add_parser(
        "doctor",
        help="one archive for whoever is asked for help",
        description="Configuration without keys, versions, machine, journal, last flights; see docs/logs.md.",
    )
    doctor.add_argument(
        "--out",
        type=Path,
        default=Path("rebound-doctor.tar.gz"),
        metavar="FILE",
        help="the archive (default: %(default)s)",
    )
    doctor.add_argument(
        "--config", type=Path, action="append", default=[], metavar="FILE", help="settings beside those of /etc/rebound"
    )
    doctor.add_argument("--preflight", type=Path, metavar="FILE", help="what `rebound preflight --json` printed")
    doctor.add_argument("--flights", type=count, default=3, metavar="N", help="how many of the last (default: 3)")
    _add_runs(doctor)
    _add_no_position(doctor)
    doctor.set_defaults(run=runs("rebound_cli.flights.doctor:run_doctor"))


def _add_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--runs", type=Path, metavar="DIR", help="where the flights are (default: runs here, or the service's)"
    )


def _add_no_position(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--no-position", action="store_true", help="without coordinates: no packets, no places in events and summary"
    )
