"""The command `rebound`: reads its arguments and turns expected errors into one sentence."""

import argparse
import errno
import itertools
import sys
import warnings
from collections.abc import Sequence

from companion.errors import ConfigurationError, ReboundError
from rebound_cli import __version__, exit_codes
from rebound_cli.airframe_arguments import add_airframe
from rebound_cli.arguments import SIMULATED_AUTOPILOTS
from rebound_cli.completion_arguments import add_completion
from rebound_cli.extras import needed_text
from rebound_cli.flights.arguments import add_doctor, add_logs
from rebound_cli.fly_arguments import add_fly
from rebound_cli.guard.arguments import add_guard
from rebound_cli.init_arguments import add_init
from rebound_cli.key_arguments import add_key
from rebound_cli.preflight.arguments import add_preflight
from rebound_cli.service.arguments import add_service
from rebound_cli.sim_arguments import add_sim
from rebound_cli.status.arguments import add_status
from rebound_cli.tool_arguments import add_check, add_identify, add_plan, add_replay, add_tune

# What writing to an open file fails with: a full disk, a limit of size or space, a broken disk or a terminal gone.
_DISK_ERRORS = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)
# Whoever ends these at once leaves a vehicle to itself.
COMMANDING = ("fly", "guard")

# Studies that were commands of the drone's program once, and what they are in the laboratory.
MOVED = {
    "paper": "paper",
    "results": "paper results",
    "detectors": "detectors",
    "campaign": "campaign",
    "recoveries": "campaign recoveries",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    words = _with_plain_sim(sys.argv[1:] if arguments is None else arguments)
    if words and words[0] in MOVED:
        text = f"'rebound {words[0]}' is now 'python -m bench {MOVED[words[0]]}', run in a checkout of Rebound"
        print(f"rebound: {text}.", file=sys.stderr)
        return exit_codes.ERROR
    return run(build_parser().parse_args(words), "rebound")


def run(options: argparse.Namespace, program: str) -> int:
    """What was asked for; an expected error is one sentence on stderr."""
    from sim_vehicle.errors import SimulationError

    warnings.formatwarning = lambda message, *_: f"{program}: {message}.\n"
    try:
        return int(options.run(options))
    except (ReboundError, SimulationError) as error:
        print(f"{program}: {error}", file=sys.stderr)
        is_permanent = isinstance(error, ConfigurationError) and options.command in COMMANDING
        return exit_codes.CONFIGURATION if is_permanent else exit_codes.ERROR
    except ModuleNotFoundError as error:
        print(f"{program}: {needed_text(error)}", file=sys.stderr)
        return exit_codes.ERROR
    except KeyboardInterrupt:
        text = "ended at once"
        if options.command in COMMANDING:
            text += "; a vehicle in the air does what its autopilot does when setpoints stop"
        print(f"{program}: {text}.", file=sys.stderr)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone (`rebound ... | head`): nobody is left to tell.
        sys.stderr.close()
        return exit_codes.ERROR
    except OSError as error:
        # A file or folder that cannot be had, or a disk that takes no more; any other error is a fault of ours.
        if error.filename is None and error.errno not in _DISK_ERRORS:
            raise
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"{program}: {where}{error.strerror}.", file=sys.stderr)
        return exit_codes.ERROR


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rebound",
        description="Detects a collision of a PX4 multicopter in one IMU sample and recovers from it.",
    )
    parser.add_argument("--version", action="version", version=f"rebound {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    add_fly(commands)
    add_guard(commands)
    add_init(commands)
    add_check(commands)
    add_plan(commands)
    add_sim(commands)
    add_preflight(commands)
    add_status(commands)
    add_logs(commands)
    add_doctor(commands)
    add_replay(commands)
    add_tune(commands)
    add_airframe(commands)
    add_identify(commands)
    add_key(commands)
    add_completion(commands)
    add_service(commands)
    return parser


def _with_plain_sim(arguments: Sequence[str]) -> list[str]:
    """`--sim` stands alone before a mission's name too, which argparse would take for its value."""
    return [
        "--sim=builtin" if word == "--sim" and after not in SIMULATED_AUTOPILOTS else word
        for word, after in itertools.zip_longest(arguments, arguments[1:])
    ]
