"""The command `python -m bench`: its studies and their options are in `studies.yaml`."""

import os
import shlex
import sys
from argparse import SUPPRESS, ArgumentParser
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from rebound_cli.arguments import count, runs
from rebound_cli.main import run

STUDIES = yaml.safe_load(Path(__file__).with_name("studies.yaml").read_text("utf-8"))
# What the file names, and what it cannot know.
TYPES = {"count": count, "path": Path}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    for gone, instead in STUDIES["gone"].items():
        if [*words][: len(gone.split())] == gone.split():
            return _refused(gone, instead)
    options = build_parser().parse_args(words)
    options.typed = shlex.join(("python", "-m", "bench", *words))
    for gone, instead in options.gone.items():
        if any(word.partition("=")[0] == gone for word in words):
            return _refused(f"{options.command} {gone}", instead)
    return run(options, "bench")


def _refused(gone: str, instead: str) -> int:
    print(f"bench: `{gone}` is no more: {instead}.", file=sys.stderr)
    return 2


def build_parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="python -m bench", description="Studies of Rebound and their tables; needs a checkout and its environment."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    for name, study in STUDIES["commands"].items():
        command = commands.add_parser(name, help=study["does"], description=study["more"])
        gone = STUDIES["gone_options"] | study.get("gone", {})
        command.set_defaults(run=runs(study["run"]), gone=gone)
        for option, settings in study["options"].items():
            command.add_argument(option, **_settings(settings))
        for option in gone:
            command.add_argument(option, nargs="?", help=SUPPRESS)
    return parser


def _settings(written: Mapping[str, Any]) -> dict[str, Any]:
    """As argparse wants them."""
    known = {"type": TYPES[written["type"]]} if "type" in written else {}
    return {**written, **known, **({"default": os.cpu_count() or 1} if written.get("default") == "cores" else {})}
