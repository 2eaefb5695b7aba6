"""The command `python -m bench`: its studies and their options are in `studies.yaml`."""

import shlex
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

import yaml

from rebound_cli.arguments import add_commands
from rebound_cli.main import run

STUDIES = yaml.safe_load(Path(__file__).with_name("studies.yaml").read_text("utf-8"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    options = build_parser().parse_args(words)
    options.typed = shlex.join(("python", "-m", "bench", *words))
    return run(options, "bench")


def build_parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="python -m bench", description="Studies of Rebound and their tables; needs a checkout and its environment."
    )
    add_commands(parser, STUDIES["commands"], {})
    return parser
