"""The command `rebound`: reads its arguments and turns expected errors into one sentence."""

import argparse
import errno
import io
import itertools
import re
import sys
import tomllib
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

from companion.errors import ConfigurationError, ReboundError
from rebound_cli import __version__, exit_codes
from rebound_cli.arguments import add_commands
from rebound_cli.extras import needed_text
from rebound_cli.inputs.shipped import shipped_examples, shipped_missions

# What writing to an open file fails with: a full disk, a limit of size or space, a broken disk or a terminal gone.
_DISK_ERRORS = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)
# Arguments whose values have names that ship, and which.
_NAMED = dict.fromkeys(("mission", "missions", "model"), "missions")
_NAMED |= {"airframe": "airframes", "example": "examples"}
# Whoever ends these at once leaves a vehicle to itself.
COMMANDING = ("fly", "guard")

TABLE = tomllib.loads(Path(__file__).with_name("commands.toml").read_text("utf-8"))


class _Parser(argparse.ArgumentParser):
    """Of a wrong word it says which one may have been meant."""

    def error(self, message: str) -> NoReturn:
        given = re.search(r"(?:invalid choice|unrecognized arguments): '?([^' ]+)", message)
        if given is not None:
            from rebound_cli.inputs.documents import nearest

            _, _, allowed = message.partition("(choose from ")
            options = [option for parser in _parsers_of(self) for option in parser._option_string_actions]
            near = nearest(given[1], re.findall(r"'([^']+)'", allowed) or options)
            message += "" if near is None else f"; did you mean {near}?"
        super().error(message)


def _parsers_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Itself and its commands'."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _parsers_of(command)


def main(words: Sequence[str] | None = None) -> int:
    # A shell's >&- leaves none.
    sys.stdout, sys.stderr = sys.stdout or io.StringIO(), sys.stderr or io.StringIO()
    words = _with_plain_sim(sys.argv[1:] if words is None else words)
    command = next(iter(words), "")
    if command in TABLE["gone"]:
        print(f"rebound: 'rebound {command}' {TABLE['gone'][command]}.", file=sys.stderr)
        return exit_codes.ERROR
    return run(build_parser(command).parse_args(words), "rebound")


def run(options: argparse.Namespace, program: str) -> int:
    """What was asked for; an expected error is one sentence on stderr."""
    from sim_vehicle.errors import SimulationError

    warnings.formatwarning = lambda message, *_: f"{program}: {message}.\n"
    code = exit_codes.ERROR
    try:
        return int(options.run(options))
    except (ReboundError, SimulationError) as error:
        said = str(error)
        if isinstance(error, ConfigurationError) and options.command in COMMANDING:
            code = exit_codes.CONFIGURATION
    except ModuleNotFoundError as error:
        said = needed_text(error)
    except KeyboardInterrupt:
        said, code = "ended at once.", exit_codes.INTERRUPTED
        if options.command in COMMANDING:
            said = "ended at once; a vehicle in the air does what its autopilot does when setpoints stop."
    except BrokenPipeError:
        # The reader of our output has gone (`rebound ... | head`): nobody is left to tell.
        sys.stderr.close()
        return code
    except UnicodeEncodeError as error:
        said = f"{error.object[error.start : error.end]!a} is no character that can be written: leave it out."
    except OSError as error:
        # A file or folder that cannot be had, or a disk that takes no more; any other error is a fault of ours.
        if error.filename is None and error.errno not in _DISK_ERRORS:
            raise
        is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        remedy = "; make room there, or write elsewhere" if is_full else ""
        said = f"{'' if error.filename is None else f'{error.filename}: '}{error.strerror}{remedy}."
    print(f"{program}: {said}", file=sys.stderr)
    return code


def build_parser(command: str = "") -> argparse.ArgumentParser:
    """Of that command alone; of all where there is none of that name."""
    text = "Detects a collision of a PX4 multicopter in one IMU sample and recovers from it."
    parser: argparse.ArgumentParser = _Parser(prog="rebound", description=text)
    parser.add_argument("--version", action="version", version=f"rebound {__version__}")
    commands = TABLE["commands"]
    add_commands(parser, {command: commands[command]} if command in commands else commands, TABLE["shared"])
    return parser


def _with_plain_sim(words: Sequence[str]) -> list[str]:
    """`--sim` stands alone before a mission's name too, which argparse would take for its value."""
    autopilots = TABLE["commands"]["fly"]["options"]["--sim"]["choices"]
    return [
        "--sim=builtin" if word == "--sim" and after not in autopilots else word
        for word, after in itertools.zip_longest(words, words[1:])
    ]


def run_completion(options: argparse.Namespace) -> None:
    """What a shell needs to complete commands, options, choices and files."""
    import shtab

    parser = build_parser()
    for action in (action for each in _parsers_of(parser) for action in each._actions):
        if (names := _NAMED.get(action.dest)) is not None:
            action.complete = {"bash": f"_rebound_{names}", "zsh": f"_rebound_{names}"}  # type: ignore[attr-defined]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, options.shell, preamble=_names_to_complete()[options.shell]))


def _names_to_complete() -> dict[str, str]:
    """Functions of each shell that offer the names that ship, and files."""
    from sim_vehicle.airframe import built_in_airframes

    shipped = {"missions": shipped_missions(), "airframes": built_in_airframes(), "examples": shipped_examples()}
    bash, zsh = "", ""
    for what, names in shipped.items():
        words = " ".join(names)
        bash += f'_rebound_{what}() {{\n  compgen -W \'{words}\' -- "$1"\n  compgen -f -- "$1"\n}}\n'
        zsh += f"_rebound_{what}() {{\n  compadd -- {words}\n  _files\n}}\n"
    return {"bash": bash, "zsh": zsh}
