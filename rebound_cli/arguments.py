"""The command line: kinds of values, and parsers of the commands that a table names."""

import argparse
import contextlib
import gc
import importlib
import math
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from rebound_cli.exit_codes import USAGE
from rebound_cli.inputs.shipped import shipped_missions

Table: TypeAlias = Mapping[str, Any]
Number = TypeVar("Number", int, float)

# What stands for a path in the help.
_PATHS = ("FILE", "DIR", "PATH", "RUN")


def number(kind: Callable[[str], Number], least: float, most: float, what: str) -> Callable[[str], Number]:
    """A type of argument: `what` it is, and how it is given."""

    def read(text: str) -> Number:
        with contextlib.suppress(ValueError):
            if least <= (value := kind(text)) <= most:
                return value
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")

    return read


port = number(int, 0, 65_535, "a port: give a number from 0 to 65535")


def mission_file(text: str) -> Path:
    """The file itself, or a mission of that name that ships with the program."""
    path = Path(text)
    if not os.path.isfile(text) and path.name == text and not path.suffix:
        return shipped_missions().get(text, path)
    return path


def host_and_port(text: str) -> tuple[str, int]:
    host, _, number = text.rpartition(":")
    if not host:
        raise argparse.ArgumentTypeError(f"{text!r} is not HOST:PORT")
    return host, int(port(number))


def _expected(text: str) -> int:
    if text != "none" and not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of collisions: give none or a whole number")
    return 0 if text == "none" else int(text)


# Faster than any vehicle. A longer range would fill the memory.
FASTEST_M_S = 1000


def speeds_m_s(text: str) -> list[float]:
    """`1..4` in whole steps, or a list."""
    first, dots, last = text.partition("..")
    try:
        steps = range(int(float(last) - float(first)) + 1) if dots else range(0)
        found = [float(first) + step for step in steps[: FASTEST_M_S + 1]]
        found = found or [float(word) for word in text.split(",")]
    except (ValueError, OverflowError):
        found = []
    if not found or not all(0.0 < speed_m_s <= FASTEST_M_S for speed_m_s in found):
        remedy = f"give 1..4 or a list such as 1,2.5, up to {FASTEST_M_S} m/s"
        raise argparse.ArgumentTypeError(f"{text!r} is not speeds: {remedy}")
    return found


# The kinds of values by the names that a table of commands has for them.
TYPES: Mapping[str, Callable[[str], Any]] = {
    "address": host_and_port,
    "collisions": _expected,
    "count": number(int, 1, math.inf, "a count: give a whole number from 1 on"),
    "flights": number(int, 1, 100_000, "a number of flights: give a whole number from 1 to 100000"),
    # PX4's SITL numbers ten of its companions' ports, 14540 to 14549.
    "instance": number(int, 0, 9, "an instance: give a number from 0 to 9"),
    "integer": int,
    "mission": mission_file,
    "path": Path,
    "port": port,
    "share": number(float, 0, 1, "a share: give a number from 0 to 1"),
    "speed": number(float, 0, 1000, "a speed: give a number from 0 to 1000, here or in PX4_SIM_SPEED_FACTOR"),
    "speeds": speeds_m_s,
    "words": lambda text: text.split(","),
}


def _run(module: str, name: str, options: argparse.Namespace) -> int:
    # Matrices of a few rows gain nothing from a thread on each core, which numpy would start now.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What is imported stays: to look for garbage in it takes a fifth of a guard's start.
    gc.disable()
    try:
        function: Callable[[argparse.Namespace], int | None] = getattr(importlib.import_module(module), name)
        gc.freeze()
        gc.enable()
        return function(options) or 0
    finally:
        gc.enable()
        gc.unfreeze()


class _Gone(argparse.Action):
    """An option of earlier versions: whoever gives it is told in a sentence what there is now."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        parser.exit(USAGE, f"{parser.prog}: {self.option_strings[0]} is gone: {self.const}.\n")


def add_commands(parser: argparse.ArgumentParser, commands: Table, shared: Table, dest: str = "command") -> None:
    """Each command of a table, with its function, its options and those that are gone.

    A function is "module:name", imported when it runs: `--help` and errors in arguments come at once. It returns an
    exit code, or nothing.
    """
    added = parser.add_subparsers(required=True, metavar=dest.upper(), dest=dest)
    for name, told in commands.items():
        command = added.add_parser(name, help=told["does"], description=told["more"])
        if "commands" in told:
            add_commands(command, told["commands"], shared, "what")
            continue
        module, _, function = told["run"].partition(":")
        command.set_defaults(run=partial(_run, module, function))
        groups: dict[str | None, Any] = {None: command}
        for option, written in told.get("options", {}).items():
            settings = _settings(written, shared)
            group = settings.pop("group", None)
            if group not in groups:
                groups[group] = command.add_mutually_exclusive_group()
            groups[group].add_argument(option, **settings)
        for option, instead in told.get("gone", {}).items():
            command.add_argument(option, nargs="?", action=_Gone, const=instead, help=argparse.SUPPRESS)


def _settings(written: Any, shared: Table) -> dict[str, Any]:
    """As argparse wants them. A text alone is a flag's; one whose value is a file or a folder has a path."""
    if isinstance(written, str):
        return {"action": "store_true", "help": written}
    settings = {**shared.get(written.get("like"), {}), **written}
    settings.pop("like", None)
    kind = settings.get("type", "path" if settings.get("metavar") in _PATHS else None)
    if kind is not None:
        settings["type"] = TYPES[kind]
    if "environment" in settings:
        settings["default"] = os.environ.get(settings.pop("environment")) or settings["default"]
    if settings.get("default") == "cores":
        settings["default"] = os.cpu_count() or 1
    return settings
