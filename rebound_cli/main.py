"""The command `rebound`: reads its arguments and turns expected errors into one sentence."""

import argparse
import errno
import itertools
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from companion.errors import ReboundError
from rebound_cli import __version__
from rebound_cli.arguments import SIMULATED_AUTOPILOTS, add_jobs, add_workers, count, hours
from rebound_cli.campaign_report.arguments import add_campaign
from rebound_cli.check.arguments import add_check
from rebound_cli.fly_arguments import add_fly
from rebound_cli.guard.arguments import add_guard
from rebound_cli.plan.arguments import add_plan
from rebound_cli.preflight.arguments import add_preflight
from rebound_cli.replay.arguments import add_replay
from rebound_cli.sim_arguments import add_sim
from rebound_cli.tune.arguments import add_tune

EXIT_ERROR = 1
# The shell's convention for a program ended by Ctrl-C: 128 + SIGINT.
EXIT_INTERRUPTED = 130
# Whoever ends these at once leaves a vehicle to itself.
COMMANDING = ("fly", "guard")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    options = build_parser().parse_args(_with_plain_sim(sys.argv[1:] if arguments is None else arguments))
    from sim_vehicle.errors import SimulationError

    try:
        return int(options.run(options))
    except (ReboundError, SimulationError) as error:
        print(f"rebound: {error}", file=sys.stderr)
        return EXIT_ERROR
    except KeyboardInterrupt:
        text = "ended at once"
        if options.command in COMMANDING:
            text += "; a vehicle in the air does what its autopilot does when setpoints stop"
        print(f"rebound: {text}.", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone (`rebound ... | head`): nobody is left to tell.
        sys.stderr.close()
        return EXIT_ERROR
    except OSError as error:
        # A file or folder that cannot be had, or a full disk; an error of any other kind is a fault of ours.
        if error.filename is None and error.errno != errno.ENOSPC:
            raise
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"rebound: {where}{error.strerror}.", file=sys.stderr)
        return EXIT_ERROR


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rebound",
        description="Detects a collision of a PX4 multicopter in one IMU sample and recovers from it.",
    )
    parser.add_argument("--version", action="version", version=f"rebound {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    add_fly(commands)
    add_guard(commands)
    add_check(commands)
    add_plan(commands)
    add_sim(commands)
    _add_results(commands)
    _add_recoveries(commands)
    add_campaign(commands)
    _add_paper(commands)
    _add_detectors(commands)
    add_preflight(commands)
    add_replay(commands)
    add_tune(commands)
    _add_airframe(commands)
    _add_identify(commands)
    return parser


def _add_results(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    results = commands.add_parser(
        "results",
        help="fly the wall hits of the paper and write the table",
        description="Lockstep wall hits at four speeds with both airframes, as a table in Markdown.",
    )
    results.add_argument(
        "--out", type=Path, default=Path("docs/results.md"), metavar="FILE", help="default: docs/results.md"
    )
    results.add_argument("--seeds", type=count, default=20, help="flights for each speed and airframe (default 20)")
    add_jobs(results)
    results.set_defaults(run=_results)


def _add_recoveries(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    recoveries = commands.add_parser(
        "recoveries",
        help="fly the same hits with two recovery laws and write the table",
        description="Lockstep wall hits at 1 to 5 m/s, square and slanted, both airframes, laws paper and adaptive.",
    )
    recoveries.add_argument(
        "--out", type=Path, default=Path("docs/recovery.md"), metavar="FILE", help="default: docs/recovery.md"
    )
    recoveries.add_argument("--seeds", type=count, default=10, help="flights for each hit and law (default 10)")
    add_jobs(recoveries)
    recoveries.set_defaults(run=_recoveries)


def _add_paper(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    paper = commands.add_parser(
        "paper",
        help="fly the paper's studies and write figures and table",
        description="The paper's figures and numbers beside ours, flown in lockstep; see docs/paper.md.",
    )
    paper.add_argument(
        "--out",
        type=Path,
        default=Path("docs"),
        metavar="DIR",
        help="folder of paper.md and images/paper (default: docs)",
    )
    paper.add_argument("--seeds", type=count, default=6, help="walls from any side: flights at each speed (default 6)")
    add_jobs(paper)
    paper.set_defaults(run=_paper)


def _add_detectors(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    detectors = commands.add_parser(
        "detectors",
        help="try every collision detector on hits and healthy flights",
        description="Simulated and recorded hits and flights through every detector; see docs/detection.md.",
    )
    detectors.add_argument("--hits", type=count, default=400, metavar="N", help="simulated hits (default 400)")
    detectors.add_argument(
        "--hours", type=hours, default=0.5, metavar="H", help="hours of simulated healthy flight (default 0.5)"
    )
    detectors.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        default=os.environ.get("REBOUND_DATA") or None,
        help="folder with px4_logs/*.ulg and drops/ for recorded flights and impacts (default: $REBOUND_DATA)",
    )
    add_workers(detectors)
    detectors.add_argument(
        "--out",
        type=Path,
        default=Path("docs"),
        metavar="DIR",
        help="folder of detection.md and images/detection (default: docs)",
    )
    detectors.set_defaults(run=_detectors)


def _add_airframe(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    airframe = commands.add_parser(
        "airframe",
        help="print an airframe for PX4",
        description="PX4's parameters for one of our airframes, on standard output.",
    )
    airframe.add_argument("target", choices=("px4",), help="for whom")
    airframe.add_argument("--airframe", default="foldable", metavar="NAME|FILE", help="default: foldable")
    airframe.add_argument(
        "--position",
        choices=("mocap", "gps", "flow"),
        default="mocap",
        help="what PX4 flies by: motion capture, as indoors (default), an RTK GPS, or optical flow and a range finder",
    )
    airframe.add_argument(
        "--format",
        choices=("env", "params", "airframe"),
        default="env",
        help="env: exports that PX4 SITL reads at start (default); params: for QGroundControl; airframe: for PX4",
    )
    airframe.set_defaults(run=_airframe)


def _add_identify(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    identify = commands.add_parser(
        "identify",
        help="find an airframe's springs in recorded hits",
        description="Fits stiffness, damping and restitution to hits on a wall; see docs/airframes.md.",
    )
    identify.add_argument(
        "data", type=Path, nargs="+", metavar="DATA", help="a CSV file, a .tlog or a run's folder: one hit each"
    )
    identify.add_argument("--mass", type=float, metavar="KG", help="of the vehicle; known for simulated runs")
    identify.add_argument("--axis", choices=("x", "y"), help="CSV: it is square to the wall (default: by the turn)")
    identify.add_argument("--out", type=Path, metavar="FILE", help="write an airframe file")
    identify.add_argument("--name", help="name of the airframe (default: the file's)")
    identify.add_argument(
        "--based-on", metavar="NAME", help="airframe for all else (default: foldable, rigid where no spring is seen)"
    )
    identify.set_defaults(run=_identify)


# The commands' modules are imported when they run: `--help` and errors in arguments come at once.
def _recoveries(options: argparse.Namespace) -> int:
    from rebound_cli.recoveries.command import run_recoveries

    return run_recoveries(options)


def _results(options: argparse.Namespace) -> int:
    from rebound_cli.results import run_results

    return run_results(options)


def _paper(options: argparse.Namespace) -> int:
    from rebound_cli.paper.command import run_paper

    return run_paper(options)


def _detectors(options: argparse.Namespace) -> int:
    from rebound_cli.detectors_report.command import run_detectors

    return run_detectors(options)


def _with_plain_sim(arguments: Sequence[str]) -> list[str]:
    """`--sim` stands alone before a mission's name too, which argparse would take for its value."""
    return [
        "--sim=builtin" if word == "--sim" and after not in SIMULATED_AUTOPILOTS else word
        for word, after in itertools.zip_longest(arguments, arguments[1:])
    ]


def _airframe(options: argparse.Namespace) -> int:
    from rebound_cli.airframe import run_airframe

    return run_airframe(options)


def _identify(options: argparse.Namespace) -> int:
    from rebound_cli.identify import run_identify

    return run_identify(options)
