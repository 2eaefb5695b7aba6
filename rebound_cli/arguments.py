"""What the commands' arguments have in common: kinds of values, and options that several commands have."""

import argparse
import contextlib
import importlib
import importlib.resources
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"

SIMULATED_AUTOPILOTS = ("builtin", "px4")


def port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65_535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port: give a number from 0 to 65535")
    return int(text)


def count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a count: give a whole number from 1 on")
    return int(text)


def mission_file(text: str) -> Path:
    """The file itself, or a mission of that name that ships with the program."""
    path = Path(text)
    if not path.exists() and path.name == text and not path.suffix:
        with contextlib.suppress(ModuleNotFoundError):
            shipped = Path(str(importlib.resources.files("rebound_missions"))) / f"{text}.yaml"
            return shipped if shipped.exists() else path
    return path


def host_and_port(text: str) -> tuple[str, int]:
    host, separator, number = text.rpartition(":")
    if not separator or not host:
        raise argparse.ArgumentTypeError(f"{text!r} is not HOST:PORT")
    return host, port(number)


def instance(text: str) -> int:
    # PX4's SITL numbers ten of its companions' ports, 14540 to 14549.
    if not text.isdecimal() or int(text) > 9:
        raise argparse.ArgumentTypeError(f"{text!r} is not an instance: give a number from 0 to 9")
    return int(text)


def speed(text: str) -> float:
    return _number(
        text, lambda value: 0 <= value <= 1000, "speed: give a number from 0 to 1000, here or in PX4_SIM_SPEED_FACTOR"
    )


def hours(text: str) -> float:
    return _number(text, lambda value: 0 < value <= 10_000, "time: give hours, such as 0.5")


def rate_hz(text: str) -> float:
    # PX4's own integration is no faster than this.
    return _number(text, lambda value: 1 <= value <= 1000, "rate: give a number of hertz from 1 to 1000")


def mass_kg(text: str) -> float:
    return _number(text, lambda value: 0 < value <= 1000, "mass: give kilograms, such as 1.1")


def share(text: str) -> float:
    return _number(text, lambda value: 0 <= value <= 1, "share: give a number from 0 to 1")


def _number(text: str, is_right: Callable[[float], bool], what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not is_right(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a {what}")
    return value


def runs(function: str) -> Callable[[argparse.Namespace], int]:
    """A command's function by "module:name", imported when it runs: `--help` and errors in arguments come at once."""
    module, _, name = function.partition(":")
    return lambda options: int(getattr(importlib.import_module(module), name)(options))


def add_jobs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=2, help="processes at a time (default 2)")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """For what is worked out on Dask: here, or wherever a scheduler has workers."""
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes (default: one a core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler whose workers do the work, e.g. tcp://10.0.0.7:8786"
    )


def add_world_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--airframe", metavar="NAME|FILE", help="foldable, rigid or an airframe file")
    parser.add_argument("--seed", type=int, help="seed of every random number of the simulated vehicle")
    add_set(parser, "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5")


def add_set(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help=text)


def add_connect(parser: "argparse.ArgumentParser | argparse._MutuallyExclusiveGroup", required: bool) -> None:
    parser.add_argument(
        "--connect",
        required=required,
        metavar="URL",
        help="a vehicle, e.g. udpin://0.0.0.0:14540 or serial:///dev/ttyAMA0:921600",
    )


def add_peer(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--peer", metavar="HOST[:PORT]", help="with udpin: hear this address alone (default: the first vehicle's)"
    )


def add_signing_key(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--signing-key",
        type=Path,
        metavar="FILE",
        help="with --connect: sign what is sent, hear only what is signed with this key; `rebound key new` makes one",
    )


def add_companion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--companion", type=Path, metavar="FILE", help="settings from this file's companion: part, as tune writes it"
    )


def add_json(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--json", action="store_true", help=f"print the {what} on stdout and nothing else there")


def add_documents_folder(parser: argparse.ArgumentParser, written: str) -> None:
    parser.add_argument(
        "--out", type=Path, default=Path("docs"), metavar="DIR", help=f"folder of {written} (default: docs)"
    )
