"""The arguments of `rebound replay`; what they run is imported when it runs."""

import argparse
from pathlib import Path


def add_replay(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    replay = commands.add_parser(
        "replay",
        help="look for collisions in a recorded flight",
        description="The detector over a .ulg, a .tlog or a run's folder; see docs/replay.md.",
    )
    replay.add_argument("log", type=Path, metavar="LOG", help="a .ulg, a .tlog or a run's folder")
    replay.add_argument("--detector", metavar="NAME", help="another detector than the mission's, or than the default")
    replay.add_argument(
        "--rate", type=_rate, metavar="HZ", help="HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    )
    replay.add_argument(
        "--companion", type=Path, metavar="FILE", help="settings from this file's companion: part, as tune writes it"
    )
    replay.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="change a setting, e.g. companion.lateral.threshold_m_s2=6",
    )
    replay.add_argument(
        "--expect", type=_expected, metavar="none|N", help="exit 1 unless there are exactly so many collisions"
    )
    replay.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the pictures (default: runs/replay-<name of the log>)"
    )
    replay.add_argument("--json", action="store_true", help="print the findings on stdout and nothing else there")
    replay.set_defaults(run=_replay)


def _replay(options: argparse.Namespace) -> int:
    from rebound_cli.replay.command import run_replay

    return run_replay(options)


def _rate(text: str) -> float:
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    # PX4's own integration is no faster than this.
    if not 1.0 <= rate_hz <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a rate: give a number of hertz from 1 to 1000")
    return rate_hz


def _expected(text: str) -> int:
    if text == "none":
        return 0
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of collisions: give none or a whole number")
    return int(text)
