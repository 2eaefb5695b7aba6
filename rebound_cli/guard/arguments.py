"""The arguments of `rebound guard`; what they run is imported when it runs."""

import argparse
from pathlib import Path


def add_guard(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    guard = commands.add_parser(
        "guard",
        help="protect a flight that something else commands",
        description="Watches; at a hit takes the vehicle over, recovers and gives it back; see docs/guard.md.",
    )
    guard.add_argument(
        "--connect", required=True, metavar="URL", help="e.g. udpin://0.0.0.0:14540 or serial:///dev/ttyAMA0:921600"
    )
    guard.add_argument("--config", type=Path, metavar="FILE", help="settings, as in docs/guard.md")
    guard.add_argument(
        "--set", action="append", default=[], metavar="PATH=VALUE", help="change a setting, e.g. max_hits=5"
    )
    guard.add_argument("--modes", metavar="A,B", help="the modes that may be taken over, e.g. POSCTL,AUTO.MISSION")
    guard.add_argument("--then", choices=("previous", "hold"), help="what the vehicle is given back to (default: hold)")
    guard.add_argument("--out", type=Path, metavar="DIR", help="where the log goes (default runs/<time>-guard)")
    guard.set_defaults(run=_guard)


def _guard(options: argparse.Namespace) -> int:
    from rebound_cli.guard.command import run_guard

    return run_guard(options)
