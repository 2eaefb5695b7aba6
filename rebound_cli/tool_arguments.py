"""The arguments of the commands that look at files and fly nothing: check, plan, replay, tune and identify."""

import argparse
import math
from pathlib import Path

from rebound_cli.arguments import (
    Commands,
    add_companion,
    add_json,
    add_set,
    mass_kg,
    mission_file,
    rate_hz,
    runs,
    share,
)


def add_check(commands: Commands) -> None:
    text = "Validates mission files, prints what would be flown and when, and draws it."
    check = commands.add_parser("check", help="check a mission file and show what would be flown", description=text)
    missions = "mission files, or names of ones that ship"
    check.add_argument("missions", type=mission_file, nargs="*", metavar="MISSION", help=missions)
    schema = "print the JSON schema of mission files, for editors, and nothing else"
    check.add_argument("--schema", action="store_true", help=schema)
    add_set(check, "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5")
    _add_out(check, "DIR", "folder of the pictures (default: runs/check)", default=Path("runs/check"))
    check.add_argument("--no-picture", action="store_true", help="draw nothing")
    check.set_defaults(run=runs("rebound_cli.check.command:run_check"))


def add_plan(commands: Commands) -> None:
    text = "Reads and writes QGroundControl's .plan files; see docs/missions.md."
    plan = commands.add_parser("plan", help="missions from and for QGroundControl", description=text)
    ways = plan.add_subparsers(required=True, metavar="import|export")
    reading = ways.add_parser("import", help="a mission file from a .plan", description="Makes a mission of a .plan.")
    reading.add_argument("plan", type=Path, metavar="PLAN", help="QGroundControl's file")
    reading.add_argument("--name", help="name of the mission (default: the file's)")
    _add_out(reading, "FILE", "default: standard output")
    reading.set_defaults(run=runs("rebound_cli.plan.command:run_import"))
    writing = ways.add_parser("export", help="a .plan from a mission file", description="Makes a .plan of a mission.")
    writing.add_argument("mission", type=mission_file, metavar="MISSION")
    home = "where the vehicle will be armed: degrees, and metres above sea level (default 0)"
    writing.add_argument("--home", type=_home, required=True, metavar="LAT,LON[,ALT]", help=home)
    _add_out(writing, "FILE", "default: standard output")
    writing.set_defaults(run=runs("rebound_cli.plan.command:run_export"))


def add_replay(commands: Commands) -> None:
    text = "The detector over a .ulg, a .tlog or a run's folder; see docs/replay.md."
    replay = commands.add_parser("replay", help="look for collisions in a recorded flight", description=text)
    replay.add_argument("log", type=Path, metavar="LOG", help="a .ulg, a .tlog or a run's folder")
    replay.add_argument("--detector", metavar="NAME", help="another detector than the mission's, or than the default")
    rate = "HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    replay.add_argument("--rate", type=rate_hz, metavar="HZ", help=rate)
    add_companion(replay)
    add_set(replay, "change a setting, e.g. companion.fused.side_threshold_m_s2=6")
    expected = "exit 1 unless there are exactly so many collisions"
    replay.add_argument("--expect", type=_expected, metavar="none|N", help=expected)
    least = "with --expect none: exit 1 where less of the flight was watched (default 0.5: most of it was not)"
    replay.add_argument("--least-watched", type=share, default=0.5, metavar="SHARE", help=least)
    _add_out(replay, "DIR", "folder of the pictures (default: runs/replay-<name of the log>)")
    add_json(replay, "findings")
    replay.set_defaults(run=runs("rebound_cli.replay.command:run_replay"))


def add_tune(commands: Commands) -> None:
    text = "Noise floor, margins and the smallest hit that would be seen, and settings; see docs/replay.md."
    tune = commands.add_parser("tune", help="settings for a vehicle from its healthy flights", description=text)
    logs = "flights without a collision: .ulg, .tlog or runs' folders"
    tune.add_argument("logs", type=Path, nargs="+", metavar="LOG", help=logs)
    tune.add_argument("--detector", metavar="NAME", help="default: the companion's")
    arms = "whose arms hit the wall (default: both foldable and rigid)"
    tune.add_argument("--airframe", metavar="NAME|FILE", help=arms)
    tune.add_argument("--companion", type=Path, metavar="FILE", help="settings to begin with (default: the defaults)")
    _add_out(tune, "FILE", "write the settings, for rebound fly --companion FILE")
    add_json(tune, "figures")
    tune.set_defaults(run=runs("rebound_cli.tune.command:run_tune"))


def add_identify(commands: Commands) -> None:
    text = "Fits stiffness, damping and restitution to hits on a wall; see docs/airframes.md."
    identify = commands.add_parser("identify", help="find an airframe's springs in recorded hits", description=text)
    data = "a CSV file, a .tlog or a run's folder: one hit each"
    identify.add_argument("data", type=Path, nargs="+", metavar="DATA", help=data)
    identify.add_argument("--mass", type=mass_kg, metavar="KG", help="of the vehicle; known for simulated runs")
    identify.add_argument("--axis", choices=("x", "y"), help="CSV: it is square to the wall (default: by the turn)")
    _add_out(identify, "FILE", "write an airframe file")
    identify.add_argument("--name", help="name of the airframe (default: the file's)")
    base = "airframe for all else (default: foldable, rigid where no spring is seen)"
    identify.add_argument("--based-on", metavar="NAME", help=base)
    identify.set_defaults(run=runs("rebound_cli.identification.command:run_identify"))


def _add_out(parser: argparse.ArgumentParser, metavar: str, text: str, default: Path | None = None) -> None:
    parser.add_argument("--out", type=Path, default=default, metavar=metavar, help=text)


def _expected(text: str) -> int:
    if text != "none" and not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of collisions: give none or a whole number")
    return 0 if text == "none" else int(text)


def _home(text: str) -> tuple[float, float, float]:
    try:
        latitude_deg, longitude_deg, altitude_m = map(float, (text if text.count(",") > 1 else f"{text},0").split(","))
    except ValueError:
        latitude_deg = longitude_deg = altitude_m = math.nan
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0 and math.isfinite(altitude_m)):
        raise argparse.ArgumentTypeError(f"{text!r} is not LAT,LON or LAT,LON,ALT, such as 47.3977,8.5456,488")
    return latitude_deg, longitude_deg, altitude_m
