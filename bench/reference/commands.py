"""The page of commands, from the argument parsers of `rebound` and of `python -m bench`: a line each."""

import argparse
import re
from collections.abc import Iterator

import bench.main
import rebound_cli.main
from bench.reference.markdown import code, table
from rebound_cli import exit_codes

_EXITS = (
    (0, "Done as asked.", "It stays ended."),
    (exit_codes.ERROR, "Failed: no vehicle, no device, a mission not completed, a check that says `no`.", "Restarted."),
    (exit_codes.USAGE, "The command line cannot be read.", "It stays ended: correct it, then `install`."),
    (exit_codes.CONFIGURATION, "The configuration is wrong: a file, a setting, an address, a key.", "It stays ended."),
    (exit_codes.INTERRUPTED, "Ctrl-C twice: ended at once.", "Restarted."),
)


def commands() -> dict[str, str]:
    return {
        "commands": table(("command", "does", "more"), _commands(rebound_cli.main.build_parser())),
        "studies": table(("study", "does", "more"), _commands(bench.main.build_parser())),
        "error": str(exit_codes.ERROR),
        "exits": table(("code", "meaning", "a guard as a service"), _EXITS),
    }


def _commands(parser: argparse.ArgumentParser, does: str = "") -> Iterator[tuple[str, str, str]]:
    """Those that run something, each with all words of its name and the page that its description names."""
    if parser.get_default("run") is not None:
        page = re.search(r"docs/([\w/-]+)\.md", parser.description or "")
        yield code(parser.prog), does, f"[{page[1].rpartition('/')[2]}](../{page[1]}.md)" if page else ""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for said in action._choices_actions:
                yield from _commands(action.choices[said.dest], said.help or "")
