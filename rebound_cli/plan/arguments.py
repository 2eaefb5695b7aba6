"""The arguments of `rebound plan`."""

import argparse
import math
from pathlib import Path

from rebound_cli.arguments import Commands, mission_file, runs


def add_plan(commands: Commands) -> None:
    plan = commands.add_parser(
        "plan",
        help="missions from and for QGroundControl",
        description="Reads and writes QGroundControl's .plan files; see docs/missions.md.",
    )
    ways = plan.add_subparsers(required=True, metavar="import|export")
    reading = ways.add_parser("import", help="a mission file from a .plan", description="Makes a mission of a .plan.")
    reading.add_argument("plan", type=Path, metavar="PLAN", help="QGroundControl's file")
    reading.add_argument("--name", help="name of the mission (default: the file's)")
    _add_out(reading, "default: standard output")
    reading.set_defaults(run=runs("rebound_cli.plan.command:run_import"))
    writing = ways.add_parser("export", help="a .plan from a mission file", description="Makes a .plan of a mission.")
    writing.add_argument("mission", type=mission_file, metavar="MISSION")
    writing.add_argument(
        "--home",
        type=_home,
        required=True,
        metavar="LAT,LON[,ALT]",
        help="where the vehicle will be armed: degrees, and metres above sea level (default 0)",
    )
    _add_out(writing, "default: standard output")
    writing.set_defaults(run=runs("rebound_cli.plan.command:run_export"))


def _add_out(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument("--out", type=Path, metavar="FILE", help=default)


def _home(text: str) -> tuple[float, float, float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    is_place = len(numbers) in (2, 3) and all(map(math.isfinite, numbers))
    if not is_place or abs(numbers[0]) > 90.0 or abs(numbers[1]) > 180.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not LAT,LON or LAT,LON,ALT, such as 47.3977,8.5456,488")
    latitude_deg, longitude_deg, *altitude_m = numbers
    return latitude_deg, longitude_deg, altitude_m[0] if altitude_m else 0.0
