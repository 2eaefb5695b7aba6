"""Options that several studies have, and the document about vehicles that are drawn."""

import math
import os
from argparse import ArgumentParser
from pathlib import Path

from rebound_cli.arguments import count, number

# Tables and pictures of one machine on one day: not committed.
BUILD = Path("build")
DRAWN_NAME, DRAWN_TITLE = "drawn.md", "Vehicles nobody tuned for"
hours = number(float, math.ulp(0.0), 10_000, "a time: give hours, such as 0.5")


def add_jobs(parser: ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=2, help="processes at a time (default 2)")


def add_workers(parser: ArgumentParser) -> None:
    """For what is worked out on Dask: here, or wherever a scheduler has workers."""
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes (default: one a core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler whose workers do the work, e.g. tcp://10.0.0.7:8786"
    )


def add_documents_folder(parser: ArgumentParser, written: str) -> None:
    parser.add_argument(
        "--out", type=Path, default=BUILD, metavar="DIR", help=f"folder of {written} (default: {BUILD})"
    )


def add_vehicles(parser: ArgumentParser, each: str) -> None:
    parser.add_argument(
        "--vehicles",
        choices=("named", "drawn"),
        default="named",
        help=f"drawn: {each} has a vehicle of its own, drawn from its seed, of both airframes' kinds "
        "(default named: the two airframes)",
    )
