"""The command line: kinds of values, options that several commands have, and the commands' own."""

import argparse
import contextlib
import gc
import importlib
import math
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from rebound_cli.shipped import shipped_missions

Parser: TypeAlias = argparse.ArgumentParser
Group: TypeAlias = argparse._MutuallyExclusiveGroup
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
Run: TypeAlias = Callable[[argparse.Namespace], int]
Number = TypeVar("Number", int, float)

SIMULATED_AUTOPILOTS = ("builtin", "px4", "ardupilot")
# What stands for a path in the help.
_PATHS = ("FILE", "DIR", "PATH", "RUN")
_SET_MISSION = "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5"


def number(kind: Callable[[str], Number], least: float, most: float, what: str) -> Callable[[str], Number]:
    """A type of argument: `what` it is, and how it is given."""

    def read(text: str) -> Number:
        with contextlib.suppress(ValueError):
            if least <= (value := kind(text)) <= most:
                return value
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")

    return read


port = number(int, 0, 65_535, "a port: give a number from 0 to 65535")
count = number(int, 1, math.inf, "a count: give a whole number from 1 on")
# PX4's SITL numbers ten of its companions' ports, 14540 to 14549.
instance = number(int, 0, 9, "an instance: give a number from 0 to 9")
speed = number(float, 0, 1000, "a speed: give a number from 0 to 1000, here or in PX4_SIM_SPEED_FACTOR")
share = number(float, 0, 1, "a share: give a number from 0 to 1")


def mission_file(text: str) -> Path:
    """The file itself, or a mission of that name that ships with the program."""
    path = Path(text)
    if not path.exists() and path.name == text and not path.suffix:
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


def _export_format(text: str) -> str:
    if text == "ulg":
        raise argparse.ArgumentTypeError("ulg is gone: give mcap, which Foxglove and PlotJuggler read")
    return text


def speeds_m_s(text: str) -> list[float]:
    """`1..4` in whole steps, or a list."""
    first, dots, last = text.partition("..")
    try:
        found = [float(first) + step for step in range(int(float(last) - float(first)) + 1)] if dots else []
        found = found or [float(word) for word in text.split(",")]
    except ValueError:
        found = []
    if not found or min(found) <= 0 or not math.isfinite(sum(found)):
        raise argparse.ArgumentTypeError(f"{text!r} is not speeds: give 1..4 or a list such as 1,2.5, in m/s")
    return found


def runs(function: str) -> Run:
    """A command's function by "module:name", imported when it runs: `--help` and errors in arguments come at once."""
    module, _, name = function.partition(":")
    return partial(_run, module, name)


def _run(module: str, name: str, options: argparse.Namespace) -> int:
    # Matrices of a few rows gain nothing from a thread on each core, which numpy would start now.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What is imported stays: to look for garbage in it takes a fifth of a guard's start.
    gc.disable()
    try:
        function = getattr(importlib.import_module(module), name)
        gc.freeze()
        gc.enable()
        return int(function(options))
    finally:
        gc.enable()
        gc.unfreeze()


def _command(commands: Commands, name: str, function: str, summary: str, description: str) -> Parser:
    parser = commands.add_parser(name, help=summary, description=description)
    parser.set_defaults(run=runs(f"rebound_cli.{function}"))
    return parser


def _option(parser: Parser | Group, name: str, text: str, metavar: str | None = None, **more: Any) -> None:
    """One whose value is a file or a folder has a path."""
    if metavar in _PATHS:
        more = {"type": Path, **more}
    parser.add_argument(name, metavar=metavar, help=text, **more)


class _Gone(argparse.Action):
    """An option of earlier versions: whoever gives it is told in a sentence what there is now."""

    def __call__(self, parser: Parser, *_: object) -> None:
        parser.error(f"{self.option_strings[0]} is gone: {self.const}.")


def _gone(parser: Parser, name: str, instead: str) -> None:
    parser.add_argument(name, nargs="?", action=_Gone, const=instead, help=argparse.SUPPRESS)


def _flag(parser: Parser, name: str, text: str) -> None:
    parser.add_argument(name, action="store_true", help=text)


def _add_world_options(parser: Parser) -> None:
    _option(parser, "--airframe", "foldable, rigid, hexa, octo, racer or an airframe file", "NAME|FILE")
    _option(parser, "--seed", "seed of every random number of the simulated vehicle", type=int)
    _add_set(parser, _SET_MISSION)


def _add_set(parser: Parser, text: str) -> None:
    _option(parser, "--set", text, "PATH=VALUE", action="append", default=[])


def _add_connect(parser: Parser | Group, required: bool) -> None:
    text = "a vehicle, e.g. udpin://0.0.0.0:14540 or serial:///dev/ttyAMA0:921600"
    _option(parser, "--connect", text, "URL", required=required)


def _add_peer_and_key(parser: Parser) -> None:
    _option(parser, "--peer", "with udpin: hear this address alone (default: the first vehicle's)", "HOST[:PORT]")
    text = "with --connect: sign what is sent, hear only what is signed with this key; `rebound key new` makes one"
    _option(parser, "--signing-key", text, "FILE")


def _add_wait(parser: Parser, where: str = "") -> None:
    _flag(parser, "--wait", f"{where}wait without end for a vehicle that is missing or restarts on the ground")


def _add_companion(parser: Parser) -> None:
    _option(parser, "--companion", "settings from this file's companion: part, as tune writes it", "FILE")


def _add_json(parser: Parser, what: str) -> None:
    _flag(parser, "--json", f"print the {what} on stdout and nothing else there")


def add_fly(commands: Commands) -> None:
    fly = _command(commands, "fly", "fly:run_fly", "fly a mission", "Fly a mission from take-off to landing.")
    _option(fly, "mission", "mission file, or the name of one that ships: wall", "MISSION", type=mission_file)
    how = fly.add_mutually_exclusive_group()
    text = (
        "start the simulated vehicle and fly it in real time over UDP, as without any of these; "
        "px4: with your PX4 as its autopilot, see docs/how-to/px4.md; "
        "ardupilot: with your Copter, in lockstep, see docs/how-to/ardupilot.md"
    )
    own, *_ = SIMULATED_AUTOPILOTS
    _option(how, "--sim", text, "px4", nargs="?", choices=SIMULATED_AUTOPILOTS, const=own, default=own)
    how.add_argument("--lockstep", action="store_true", help="simulate in this process, as fast as the machine allows")
    _add_connect(how, required=False)
    _add_world_options(fly)
    _option(fly, "--out", "folder of this run (default: runs/<time>-<mission>)", "DIR")
    text = "with --sim px4 or ardupilot: the autopilot's instance (its option -i or -I)"
    _option(fly, "--instance", text, "N", type=instance, default=0)
    _add_companion(fly)
    _option(fly, "--resume", "go on with the mission where the flight in this folder was interrupted", "RUN")
    _option(fly, "--obstacles", "what is known beforehand, e.g. another run's obstacles.json", "FILE")
    _flag(fly, "--watch", "open the flight in a browser while it is flown, as `rebound watch` shows it")
    _add_json(fly, "summary")
    _add_peer_and_key(fly)
    _add_wait(fly, "with --connect: ")
    _flag(fly, "--yes", "with --connect: fly the plan without asking")


def add_guard(commands: Commands) -> None:
    text = "Watches; at a hit takes the vehicle over, recovers and gives it back; see docs/how-to/guard.md."
    guard = _command(commands, "guard", "guard:run_guard", "protect a flight that something else commands", text)
    _add_connect(guard, required=True)
    text = (
        "be the link: programs and ground stations come here, e.g. udpin://0.0.0.0:14540; give it once for each address"
    )
    _option(guard, "--between", text, "URL", action="append", default=[])
    _add_wait(guard)
    _add_peer_and_key(guard)
    _option(guard, "--config", "settings, as in docs/how-to/guard.md", "FILE")
    _add_set(guard, "change a setting, e.g. max_hits=5")
    _option(guard, "--modes", "the modes that may be taken over, e.g. POSCTL,AUTO.MISSION", "A,B")
    _option(guard, "--then", "what the vehicle is given back to (default: hold)", choices=("previous", "hold"))
    _option(guard, "--out", "where the log goes (default runs/<time>-guard)", "DIR")


def add_init(commands: Commands) -> None:
    text = "A copy, to be changed, of a mission or an example that ships with the program; see docs/how-to/missions.md."
    init = _command(commands, "init", "beginning.init:run_init", "write a mission or an example to begin with", text)
    _option(init, "file", "the file to write, such as my-mission.yaml", "FILE", nargs="?")
    _flag(init, "--list", "show the names to begin from, and write nothing")
    _option(init, "--from", "which one (default: wall)", "MISSION", dest="model", default="wall")
    _option(init, "--example", "write this example instead, by default under its own name", "NAME")


def add_sim(commands: Commands) -> None:
    text = "A simulated PX4 multicopter for any MAVLink client."
    sim = _command(commands, "sim", "simulation.command:run_sim", "run the simulated vehicle alone", text)
    _option(sim, "--mission", "mission whose sim: part describes the world", "MISSION", type=mission_file)
    _add_world_options(sim)
    text = "px4: your PX4 SITL flies the vehicle's body in lockstep, see docs/how-to/px4.md"
    _option(sim, "--autopilot", text, choices=("builtin", "px4"), default="builtin")
    text = (
        "UDP port to listen on for the companion (default 14580 + instance; 0: any free one); "
        "with --autopilot px4 the TCP port (4560)"
    )
    _option(sim, "--port", text, type=port)
    text = "with --autopilot px4: where to listen for it (default 127.0.0.1: this machine alone)"
    _option(sim, "--host", text, "ADDRESS", default="127.0.0.1")
    text = "at most N times real time, 0 for as fast as it goes (default: $PX4_SIM_SPEED_FACTOR, else 1)"
    _option(sim, "--speed", text, "N", type=speed, default=os.environ.get("PX4_SIM_SPEED_FACTOR") or "1")
    text = "with --autopilot px4: HIL_SENSOR a second; 250 is three times as fast and less like a real sensor"
    _option(sim, "--sensor-rate", text, type=int, choices=(250, 500, 1000), default=1000)
    text = "where the companion's link sends unasked (default 127.0.0.1:14540 + instance)"
    _option(sim, "--remote", text, "HOST:PORT", type=host_and_port)
    text = "one more link, e.g. tcpin://0.0.0.0:5760"
    _option(sim, "--link", text, "URL", action="append", default=[])
    _option(sim, "--instance", "adds N to the UDP ports and to the system's number", "N", type=instance, default=0)
    _option(sim, "--truth", "write what really happened to this .npz file at the end", "FILE")
    _gone(sim, "--signing", "with --signing-key the vehicle signs as PX4 1.17 does")
    _option(sim, "--signing-key", "it has this key and signs as PX4 1.17 does; MAV_SIGN_CFG is 1", "FILE")
    _flag(sim, "--stop-with-stdin", "end when standard input ends")


def add_preflight(commands: Commands) -> None:
    text = "Parameters, streams, time, estimate and vibration, each with what to do; see docs/how-to/preflight.md."
    summary = "look at a connected vehicle before its first flight"
    preflight = _command(commands, "preflight", "preflight.command:run_preflight", summary, text)
    _add_connect(preflight, required=True)
    _add_peer_and_key(preflight)
    _add_companion(preflight)
    _gone(preflight, "--card", "`rebound init --example first-flight` writes the steps to the first hit")
    _flag(preflight, "--fix", "offer to set the parameters that would mend it")
    _gone(preflight, "--yes", "--fix asks before it sets a parameter")
    _add_json(preflight, "findings")


def add_status(commands: Commands) -> None:
    text = "Asks a running `guard` or `fly --connect` on this machine; see docs/how-to/flights.md."
    status = _command(commands, "status", "live.status:run_status", "what a running guard or flight is doing", text)
    _option(status, "--socket", "where to ask (default: this session, then the service)", "PATH")
    _add_json(status, "status")


def add_logs(commands: Commands) -> None:
    text = "Flights that `fly --connect` and `guard` have recorded; see docs/how-to/flights.md."
    logs = commands.add_parser("logs", help="recorded flights of real vehicles: list, show, export", description=text)
    whats = logs.add_subparsers(required=True, metavar="WHAT", dest="what")
    listed, shown, exported = (
        _command(whats, name, f"{module}.command:run_{name}", text, f"{text.capitalize()}.")
        for name, module, text in (
            ("list", "flights", "every flight, the oldest first"),
            ("show", "flights", "what happened in a flight"),
            ("export", "export", "one file of a flight"),
        )
    )
    for parser in (shown, exported):
        _option(parser, "flight", "its name or folder (default: last)", "FLIGHT", nargs="?", default="last")
    for parser in (listed, shown, exported):
        _add_runs(parser)
    _add_json(listed, "flights")
    _add_json(shown, "flight")
    text = "archive: all its files (default); mcap: for Foxglove and PlotJuggler"
    _option(exported, "--format", text, type=_export_format, choices=("archive", "mcap"), default="archive")
    _option(exported, "--out", "the file (default: FLIGHT.tar.gz or .mcap)", "FILE")
    _gone(exported, "--no-position", "`rebound report FLIGHT --no-position` makes a page without coordinates")


def add_report(commands: Commands) -> None:
    text = "One file that any browser opens, without a network; see docs/how-to/report.md."
    report = _command(commands, "report", "report.page:run_report", "a recorded flight as a page to look at", text)
    _option(report, "flight", "a run's folder, or a flight's name (default: last)", "RUN", nargs="?", default="last")
    _add_runs(report)
    _option(report, "--out", "the page (default: report.html in the run's folder)", "FILE")
    _flag(report, "--no-position", "without coordinates: no places, in texts and the summary either")


def add_watch(commands: Commands) -> None:
    text = "The report's page while a flight goes on; only reads its folder; see docs/how-to/report.md."
    watch = _command(commands, "watch", "report.live_server:run_watch", "a flight in a browser while it is flown", text)
    text = "the run's folder (default: that of the running guard or flight)"
    _option(watch, "flight", text, "RUN", type=Path, nargs="?")
    _option(
        watch, "--host", "where to listen (default: %(default)s, this machine alone)", "ADDRESS", default="127.0.0.1"
    )
    _option(watch, "--port", "TCP port (default: any free one)", type=port, default=0)


def _add_runs(parser: Parser) -> None:
    _option(parser, "--runs", "where the flights are (default: runs here, or the service's)", "DIR")


def add_check(commands: Commands) -> None:
    text = "Validates mission files, prints what would be flown and when, and draws it."
    summary = "check a mission file and show what would be flown"
    check = _command(commands, "check", "check.command:run_check", summary, text)
    text = "mission files, or names of ones that ship"
    _option(check, "missions", text, "MISSION", type=mission_file, nargs="*")
    _flag(check, "--schema", "print the JSON schema of mission files, for editors, and nothing else")
    _add_set(check, _SET_MISSION)
    _option(check, "--out", "folder of the pages (default: runs/check)", "DIR", default=Path("runs/check"))
    _flag(check, "--no-picture", "draw nothing")


def add_compare(commands: Commands) -> None:
    text = "Simulated flights on all cores: a table, a CSV and a page; see docs/how-to/missions.md."
    summary = "fly a mission by several laws, speeds and seeds"
    compare = _command(commands, "compare", "compare.command:run_compare", summary, text)
    _option(compare, "mission", "mission file, or the name of one that ships", "MISSION", type=mission_file)
    _option(compare, "--airframe", "foldable, rigid, hexa, octo, racer or an airframe file", "NAME|FILE")
    _option(compare, "--laws", "e.g. paper,adaptive (default: the mission's)", "A,B", type=lambda text: text.split(","))
    text = "of the first item that has a speed, e.g. 1..4 or 1,2.5 (default: the mission's)"
    _option(compare, "--speeds", text, "M/S", type=speeds_m_s)
    _option(
        compare, "--seeds", "flights of each, with seeds from 1 on (default: %(default)s)", "N", type=count, default=10
    )
    _add_set(compare, _SET_MISSION)
    _option(compare, "--scheduler", "of Dask, whose workers fly (default: all cores of this machine)", "ADDRESS")
    _option(compare, "--out", "folder of all (default: runs/<time>-compare-<mission>)", "DIR")


def add_replay(commands: Commands) -> None:
    text = "The detector over a .ulg, .bin or .tlog, or a run's folder; see docs/how-to/recorded-flights.md."
    replay = _command(commands, "replay", "replaying:run_replay", "look for collisions in a recorded flight", text)
    _option(replay, "log", "a .ulg, .bin or .tlog, or a run's folder", "LOG", type=Path)
    _option(replay, "--detector", "another detector than the mission's, or than the default", "NAME")
    _gone(replay, "--rate", "a log is searched as it was recorded")
    _add_companion(replay)
    _add_set(replay, "change a setting, e.g. companion.fused.side_threshold_m_s2=6")
    _option(replay, "--expect", "exit 1 unless there are exactly so many collisions", "none|N", type=_expected)
    text = "watch whoever flies, in every mode; default: only where `rebound guard` would take over"
    replay.add_argument("--any-mode", action="store_true", help=text)
    text = "with --expect none: exit 1 where less of the flight was watched (default 0.5: most of it was not)"
    _option(replay, "--least-watched", text, "SHARE", type=share, default=0.5)
    _gone(replay, "--merge", "`rebound logs export RUN --format mcap` writes a file with a flight's events and hits")
    _option(replay, "--out", "folder of the page (default: runs/replay-<name of the log>)", "DIR")
    _gone(replay, "--json", "--expect sets the exit code, and the page has the data as CSV and JSON")


def add_tune(commands: Commands) -> None:
    text = (
        "False alarms, the smallest hit that shows, settings with their margins; see docs/how-to/recorded-flights.md."
    )
    tune = _command(commands, "tune", "replay.tune:run_tune", "settings for a vehicle from its healthy flights", text)
    text = "flights without a collision: .ulg, .bin, .tlog or runs' folders"
    _option(tune, "logs", text, "LOG", type=Path, nargs="+")
    _option(tune, "--detector", "default: the companion's", "NAME")
    _gone(tune, "--airframe", "the smallest hit that shows is the detector's own promise, whatever the arms")
    _option(tune, "--companion", "settings to begin with (default: the defaults)", "FILE")
    _option(tune, "--out", "write the settings, for rebound fly --companion FILE", "FILE")
    _gone(tune, "--json", "the settings are YAML, which a program reads as well")


def add_airframe(commands: Commands) -> None:
    text = "PX4's or ArduPilot's parameters for one of our airframes, on standard output."
    what = "print an airframe"
    airframe = _command(commands, "airframe", "beginning.airframe:run_airframe", what, text)
    _option(airframe, "target", "for whom", choices=("px4", "ardupilot"))
    _option(airframe, "--airframe", "default: foldable", "NAME|FILE", default="foldable")
    text = "px4: what it flies by: motion capture, as indoors (default), an RTK GPS, or optical flow and a range finder"
    _option(airframe, "--position", text, choices=("mocap", "gps", "flow"))
    text = "px4: env, exports that PX4 SITL reads at start (default); params, for QGroundControl; airframe, for PX4"
    _option(airframe, "--format", text, choices=("env", "params", "airframe"))


def add_key(commands: Commands) -> None:
    text = "The key that a vehicle and those who may command it share; see docs/how-to/security.md."
    key = _command(commands, "key", "beginning.key:run_key", "make a key for MAVLink's message signing", text)
    text = "new: make a key; px4: write it as the file that PX4 has on its SD card"
    _option(key, "what", text, choices=("new", "px4"))
    _option(key, "file", "the key's file", "FILE")
    text = "new: ask for a passphrase, from which QGroundControl and MAVProxy make the same key (SHA-256)"
    _flag(key, "--passphrase", text)
    text = "px4: the file to write, to be copied to mavlink/ on the card (default: %(default)s)"
    _option(key, "--card", text, "FILE", default=Path("mavlink-signing-key.bin"))


def add_completion(commands: Commands) -> None:
    text = 'Prints a script for a shell to read: eval "$(rebound completion bash)" completes its words.'
    completion = _command(commands, "completion", "main:run_completion", "completion for a shell", text)
    completion.add_argument("shell", choices=("bash", "zsh"))


def add_service(commands: Commands) -> None:
    text = "Started at boot, watched, started again; see docs/how-to/service.md."
    summary = "install the guard, or a mission, as a service of systemd"
    service = _command(commands, "service", "service.command:run_service", summary, text)
    text = (
        "install: also after an upgrade, keeps all settings; status: as systemd sees it; "
        "check: whether all is as it should be; uninstall: keeps settings and flights"
    )
    _option(service, "what", text, choices=("install", "status", "check", "uninstall"))
    how = service.add_mutually_exclusive_group()
    _option(how, "--guard", "install: guard with these settings, from boot on", "CONFIG", type=Path)
    _option(how, "--mission", "install: fly this each time somebody starts the service", "FILE", type=mission_file)
    _add_connect(service, required=False)
    _flag(service, "--dry-run", "show what would be written or removed, and stop")


# In the order of `rebound --help`.
COMMANDS = (
    *(
        add_fly,
        add_guard,
        add_init,
        add_check,
        add_compare,
        add_sim,
        add_preflight,
        add_status,
        add_logs,
        add_report,
        add_watch,
    ),
    *(add_replay, add_tune, add_airframe, add_key, add_completion, add_service),
)
