"""The arguments of `rebound tune`; what they run is imported when it runs."""

import argparse
from pathlib import Path


def add_tune(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    tune = commands.add_parser(
        "tune",
        help="settings for a vehicle from its healthy flights",
        description="Noise floor, margins and the smallest hit that would be seen, and settings; see docs/replay.md.",
    )
    tune.add_argument(
        "logs", type=Path, nargs="+", metavar="LOG", help="flights without a collision: .ulg, .tlog or runs' folders"
    )
    tune.add_argument("--detector", metavar="NAME", help="default: the companion's")
    tune.add_argument(
        "--airframe", metavar="NAME|FILE", help="whose arms hit the wall (default: both foldable and rigid)"
    )
    tune.add_argument("--companion", type=Path, metavar="FILE", help="settings to begin with (default: the defaults)")
    tune.add_argument("--out", type=Path, metavar="FILE", help="write the settings, for rebound fly --companion FILE")
    tune.add_argument("--json", action="store_true", help="print the figures on stdout and nothing else there")
    tune.set_defaults(run=_tune)


def _tune(options: argparse.Namespace) -> int:
    from rebound_cli.tune.command import run_tune

    return run_tune(options)
