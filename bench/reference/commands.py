"""The pages of commands, from the argument parsers of `rebound` and of `python -m bench`."""

import argparse
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


def program_page() -> str:
    text = "# Commands\n\nEvery command of `rebound`. `rebound COMMAND --help` prints the same.\n\n"
    text += "".join(_command(parser) for parser in _commands(rebound_cli.main.build_parser()))
    text += (
        "## Exit codes\n\n`fly` and `guard` tell a wrong configuration from other failures. Other commands end with "
    )
    text += f"{exit_codes.ERROR} there.\n\n"
    return text + table(("code", "meaning", "a guard as a service"), _EXITS)


def studies_page() -> str:
    text = "# Studies\n\nEvery study of `python -m bench`. Studies need a checkout.\n\n"
    return text + "".join(_command(parser) for parser in _commands(bench.main.build_parser()))


def _commands(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Those that run something, each with all words of its name."""
    children = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if parser.get_default("run") is not None:
        yield parser
    for action in children:
        for child in action.choices.values():
            yield from _commands(child)


def _command(parser: argparse.ArgumentParser) -> str:
    actions = [a for a in parser._actions if not isinstance(a, argparse._HelpAction | argparse._SubParsersAction)]
    rows = [(_name(a), _help(parser, a), _default(a)) for a in actions]
    return f"## {parser.prog}\n\n{parser.description}\n\n" + table(("argument", "meaning", "default"), rows) + "\n"


def _name(action: argparse.Action) -> str:
    value = action.metavar or (action.dest.upper() if action.option_strings else action.dest)
    if action.choices is not None and action.metavar is None:
        value = "{" + ",".join(map(str, action.choices)) + "}"
    if not action.option_strings:
        return code(value)
    flag = ", ".join(action.option_strings)
    return code(flag if action.nargs == 0 else f"{flag} {value}")


def _help(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    return (action.help or "") % {**vars(action), "prog": parser.prog}


def _default(action: argparse.Action) -> str:
    if action.default in (None, False, [], argparse.SUPPRESS) or action.dest == "speed" or action.dest == "jobs":
        return ""
    return code(action.default)
