"""The arguments of `bench detectors`."""

import os
from argparse import ArgumentParser
from pathlib import Path

from bench.arguments import add_documents_folder, add_vehicles, add_workers, hours
from rebound_cli.arguments import Commands, count, runs


def add_data(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        default=os.environ.get("REBOUND_DATA") or None,
        help="folder with px4_logs/*.ulg and drops/ for recorded flights and impacts (default: $REBOUND_DATA)",
    )


def add_detectors(commands: Commands) -> None:
    detectors = commands.add_parser(
        "detectors",
        help="try every collision detector on hits and healthy flights",
        description="Simulated and recorded hits and flights through every detector; see bench/notes/results.md.",
    )
    detectors.add_argument("--hits", type=count, default=400, metavar="N", help="simulated hits (default 400)")
    detectors.add_argument(
        "--hours", type=hours, default=0.5, metavar="H", help="hours of simulated healthy flight (default 0.5)"
    )
    detectors.add_argument(
        "--first-seed", type=count, default=0, metavar="SEED", help="of the first case; the others follow (default 0)"
    )
    add_vehicles(detectors, "every case")
    add_data(detectors)
    add_workers(detectors)
    add_documents_folder(detectors, "detection.md and images/detection, or of drawn.md")
    detectors.set_defaults(run=runs("bench.detectors_report.command:run_detectors"))
