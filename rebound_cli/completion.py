"""`rebound completion`: what a shell needs to complete commands, options, choices and files."""

import argparse
from pathlib import Path

import shtab

from rebound_cli.arguments import mission_file
from rebound_cli.main import build_parser

# Types of arguments that are files.
_FILES = (Path, mission_file)


def run_completion(options: argparse.Namespace) -> int:
    parser = build_parser()
    _complete_files(parser)
    print(shtab.complete(parser, options.shell))
    return 0


def _complete_files(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_files(command)
        elif action.type in _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
