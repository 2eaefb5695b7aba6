"""The arguments of `rebound preflight`; what they run is imported when it runs."""

import argparse
from pathlib import Path


def add_preflight(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    preflight = commands.add_parser(
        "preflight",
        help="look at a connected vehicle before its first flight",
        description="Parameters, streams, time, estimate and vibration, each with its remedy; see docs/preflight.md.",
    )
    preflight.add_argument(
        "--connect", required=True, metavar="URL", help="e.g. udpin://0.0.0.0:14540 or serial:///dev/ttyAMA0:921600"
    )
    preflight.add_argument(
        "--companion", type=Path, metavar="FILE", help="settings from this file's companion: part, as tune writes it"
    )
    preflight.add_argument("--fix", action="store_true", help="offer to set the parameters that would mend it")
    preflight.add_argument("--yes", action="store_true", help="with --fix: set them without asking")
    preflight.add_argument("--json", action="store_true", help="print the findings on stdout and nothing else there")
    preflight.set_defaults(run=_preflight)


def _preflight(options: argparse.Namespace) -> int:
    from rebound_cli.preflight.command import run_preflight

    return run_preflight(options)
