"""The arguments of `rebound tune`."""

from pathlib import Path

from rebound_cli.arguments import Commands, add_json, runs


def add_tune(commands: Commands) -> None:
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
    add_json(tune, "figures")
    tune.set_defaults(run=runs("rebound_cli.tune.command:run_tune"))
