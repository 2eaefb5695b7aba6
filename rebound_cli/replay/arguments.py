"""The arguments of `rebound replay`."""

import argparse
from pathlib import Path

from rebound_cli.arguments import Commands, add_companion, add_json, add_set, rate_hz, runs


def add_replay(commands: Commands) -> None:
    replay = commands.add_parser(
        "replay",
        help="look for collisions in a recorded flight",
        description="The detector over a .ulg, a .tlog or a run's folder; see docs/replay.md.",
    )
    replay.add_argument("log", type=Path, metavar="LOG", help="a .ulg, a .tlog or a run's folder")
    replay.add_argument("--detector", metavar="NAME", help="another detector than the mission's, or than the default")
    replay.add_argument(
        "--rate", type=rate_hz, metavar="HZ", help="HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    )
    add_companion(replay)
    add_set(replay, "change a setting, e.g. companion.fused.side_threshold_m_s2=6")
    replay.add_argument(
        "--expect", type=_expected, metavar="none|N", help="exit 1 unless there are exactly so many collisions"
    )
    replay.add_argument(
        "--least-watched",
        type=_share,
        default=0.5,
        metavar="SHARE",
        help="with --expect none: exit 1 where less of the flight was watched (default 0.5: most of it was not)",
    )
    replay.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the pictures (default: runs/replay-<name of the log>)"
    )
    add_json(replay, "findings")
    replay.set_defaults(run=runs("rebound_cli.replay.command:run_replay"))


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a share: give a number from 0 to 1")
    return value


def _expected(text: str) -> int:
    if text == "none":
        return 0
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of collisions: give none or a whole number")
    return int(text)
