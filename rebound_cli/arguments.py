"""Kinds of arguments that the command line takes: text to value, or a sentence why not."""

import argparse
import os

SIMULATED_AUTOPILOTS = ("builtin", "px4")


def port(text: str) -> int:
    if not text.isdigit() or int(text) > 65_535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port: give a number from 0 to 65535")
    return int(text)


def count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a count: give a whole number from 1 on")
    return int(text)


def host_and_port(text: str) -> tuple[str, int]:
    host, separator, number = text.rpartition(":")
    if not separator or not host:
        raise argparse.ArgumentTypeError(f"{text!r} is not HOST:PORT")
    return host, port(number)


def instance(text: str) -> int:
    # PX4's SITL numbers ten of its companions' ports, 14540 to 14549.
    if not text.isdigit() or int(text) > 9:
        raise argparse.ArgumentTypeError(f"{text!r} is not an instance: give a number from 0 to 9")
    return int(text)


def speed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1000:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a speed: give a number from 0 to 1000, here or in PX4_SIM_SPEED_FACTOR"
        )
    return value


def hours(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= 10_000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time: give hours, such as 0.5")
    return value


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
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5",
    )
