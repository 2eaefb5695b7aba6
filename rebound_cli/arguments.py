"""The command line: kinds of values, options that several commands have, and the commands' own."""

import argparse
import contextlib
import importlib
import importlib.resources
import math
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeAlias, TypeVar

Parser: TypeAlias = argparse.ArgumentParser
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
Run: TypeAlias = Callable[[argparse.Namespace], int]
Number = TypeVar("Number", int, float)

SIMULATED_AUTOPILOTS = ("builtin", "px4")


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
# PX4's own integration is no faster than this.
rate_hz = number(float, 1, 1000, "a rate: give a number of hertz from 1 to 1000")
share = number(float, 0, 1, "a share: give a number from 0 to 1")
mass_kg = number(float, math.ulp(0.0), 1000, "a mass: give kilograms, such as 1.1")


def mission_file(text: str) -> Path:
    """The file itself, or a mission of that name that ships with the program."""
    path = Path(text)
    if not path.exists() and path.name == text and not path.suffix:
        with contextlib.suppress(ModuleNotFoundError):
            shipped = Path(str(importlib.resources.files("rebound_missions"))) / f"{text}.yaml"
            return shipped if shipped.exists() else path
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


def _home(text: str) -> tuple[float, float, float]:
    try:
        latitude_deg, longitude_deg, altitude_m = map(float, (text if text.count(",") > 1 else f"{text},0").split(","))
    except ValueError:
        latitude_deg = longitude_deg = altitude_m = math.nan
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0 and math.isfinite(altitude_m)):
        raise argparse.ArgumentTypeError(f"{text!r} is not LAT,LON or LAT,LON,ALT, such as 47.3977,8.5456,488")
    return latitude_deg, longitude_deg, altitude_m


def runs(function: str) -> Run:
    """A command's function by "module:name", imported when it runs: `--help` and errors in arguments come at once."""
    module, _, name = function.partition(":")
    return partial(_run, module, name)


def _run(module: str, name: str, options: argparse.Namespace) -> int:
    return int(getattr(importlib.import_module(module), name)(options))


def _command(commands: Commands, name: str, function: str, summary: str, description: str) -> Parser:
    parser = commands.add_parser(name, help=summary, description=description)
    parser.set_defaults(run=runs(f"rebound_cli.{function}"))
    return parser


def _add_world_options(parser: Parser) -> None:
    parser.add_argument("--airframe", metavar="NAME|FILE", help="foldable, rigid or an airframe file")
    parser.add_argument("--seed", type=int, help="seed of every random number of the simulated vehicle")
    _add_set(parser, "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5")


def _add_set(parser: Parser, text: str) -> None:
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help=text)


def _add_connect(parser: "Parser | argparse._MutuallyExclusiveGroup", required: bool) -> None:
    text = "a vehicle, e.g. udpin://0.0.0.0:14540 or serial:///dev/ttyAMA0:921600"
    parser.add_argument("--connect", required=required, metavar="URL", help=text)


def _add_peer_and_key(parser: Parser) -> None:
    text = "with udpin: hear this address alone (default: the first vehicle's)"
    parser.add_argument("--peer", metavar="HOST[:PORT]", help=text)
    text = "with --connect: sign what is sent, hear only what is signed with this key; `rebound key new` makes one"
    parser.add_argument("--signing-key", type=Path, metavar="FILE", help=text)


def _add_out(parser: Parser, metavar: str, text: str, default: Path | None = None) -> None:
    parser.add_argument("--out", type=Path, default=default, metavar=metavar, help=text)


def _add_companion(parser: Parser) -> None:
    text = "settings from this file's companion: part, as tune writes it"
    parser.add_argument("--companion", type=Path, metavar="FILE", help=text)


def _add_json(parser: Parser, what: str) -> None:
    parser.add_argument("--json", action="store_true", help=f"print the {what} on stdout and nothing else there")


def add_fly(commands: Commands) -> None:
    fly = _command(commands, "fly", "fly:run_fly", "fly a mission", "Fly a mission from take-off to landing.")
    text = "mission file, or the name of one that ships: wall"
    fly.add_argument("mission", type=mission_file, metavar="MISSION", help=text)
    how = fly.add_mutually_exclusive_group()
    text = (
        "start the simulated vehicle and fly it in real time over UDP, as without any of these; "
        "px4: with your PX4 as its autopilot, see docs/how-to/px4.md"
    )
    own, *_ = SIMULATED_AUTOPILOTS
    how.add_argument("--sim", nargs="?", choices=SIMULATED_AUTOPILOTS, const=own, default=own, metavar="px4", help=text)
    how.add_argument("--lockstep", action="store_true", help="simulate in this process, as fast as the machine allows")
    _add_connect(how, required=False)
    _add_world_options(fly)
    _add_out(fly, "DIR", "folder of this run (default: runs/<time>-<mission>)")
    text = "with --sim px4: PX4's instance (its option -i)"
    fly.add_argument("--instance", type=instance, default=0, metavar="N", help=text)
    _add_companion(fly)
    text = "go on with the mission where the flight in this folder was interrupted"
    fly.add_argument("--resume", type=Path, metavar="RUN", help=text)
    text = "what is known beforehand, e.g. another run's obstacles.json"
    fly.add_argument("--obstacles", type=Path, metavar="FILE", help=text)
    _add_json(fly, "summary")
    _add_peer_and_key(fly)
    fly.add_argument("--yes", action="store_true", help="with --connect: fly the plan without asking")


def add_guard(commands: Commands) -> None:
    text = "Watches; at a hit takes the vehicle over, recovers and gives it back; see docs/how-to/guard.md."
    guard = _command(commands, "guard", "guard:run_guard", "protect a flight that something else commands", text)
    _add_connect(guard, required=True)
    _add_peer_and_key(guard)
    guard.add_argument("--config", type=Path, metavar="FILE", help="settings, as in docs/how-to/guard.md")
    _add_set(guard, "change a setting, e.g. max_hits=5")
    guard.add_argument("--modes", metavar="A,B", help="the modes that may be taken over, e.g. POSCTL,AUTO.MISSION")
    guard.add_argument("--then", choices=("previous", "hold"), help="what the vehicle is given back to (default: hold)")
    _add_out(guard, "DIR", "where the log goes (default runs/<time>-guard)")


def add_init(commands: Commands) -> None:
    text = "A copy, to be changed, of one of the missions that ship with the program; see docs/how-to/missions.md."
    init = _command(commands, "init", "init:run_init", "write a mission to begin with", text)
    init.add_argument("file", type=Path, metavar="FILE", help="the file to write, such as my-mission.yaml")
    init.add_argument("--from", dest="model", default="wall", metavar="MISSION", help="which one (default: wall)")


def add_sim(commands: Commands) -> None:
    text = "A simulated PX4 quadrotor for any MAVLink client."
    sim = _command(commands, "sim", "sim:run_sim", "run the simulated vehicle alone", text)
    sim.add_argument("--mission", type=Path, metavar="FILE", help="mission file whose sim: part describes the world")
    _add_world_options(sim)
    text = "px4: your PX4 SITL flies the vehicle's body in lockstep, see docs/how-to/px4.md"
    sim.add_argument("--autopilot", choices=SIMULATED_AUTOPILOTS, default="builtin", help=text)
    text = (
        "UDP port to listen on for the companion (default 14580 + instance; 0: any free one); "
        "with --autopilot px4 the TCP port (4560)"
    )
    sim.add_argument("--port", type=port, help=text)
    text = "with --autopilot px4: where to listen for it (default 127.0.0.1: this machine alone)"
    sim.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help=text)
    text = "at most N times real time, 0 for as fast as it goes (default: $PX4_SIM_SPEED_FACTOR, else 1)"
    default = os.environ.get("PX4_SIM_SPEED_FACTOR") or "1"
    sim.add_argument("--speed", type=speed, default=default, metavar="N", help=text)
    text = "with --autopilot px4: HIL_SENSOR a second; 250 is three times as fast and less like a real sensor"
    sim.add_argument("--sensor-rate", type=int, choices=(250, 500, 1000), default=1000, help=text)
    text = "where the companion's link sends unasked (default 127.0.0.1:14540 + instance)"
    sim.add_argument("--remote", type=host_and_port, metavar="HOST:PORT", help=text)
    text = "one more link, e.g. tcpin://0.0.0.0:5760 or serial:///dev/ttyUSB0:57600"
    sim.add_argument("--link", action="append", default=[], metavar="URL", help=text)
    text = "adds N to the UDP ports and to the system's number"
    sim.add_argument("--instance", type=instance, default=0, metavar="N", help=text)
    text = "write what really happened to this .npz file at the end"
    sim.add_argument("--truth", type=Path, metavar="FILE", help=text)
    text = "how it is given a key of message signing: by SETUP_SIGNING on any link, or as PX4 1.17"
    sim.add_argument("--signing", choices=("any-link", "px4-1.17"), default="any-link", help=text)
    sim.add_argument("--signing-key", type=Path, metavar="FILE", help="it has this key, and MAV_SIGN_CFG is 1")
    sim.add_argument("--stop-with-stdin", action="store_true", help="end when standard input ends")


def add_preflight(commands: Commands) -> None:
    text = "Parameters, streams, time, estimate and vibration, each with its remedy; see docs/how-to/preflight.md."
    summary = "look at a connected vehicle before its first flight"
    preflight = _command(commands, "preflight", "preflight:run_preflight", summary, text)
    _add_connect(preflight, required=True)
    _add_peer_and_key(preflight)
    _add_companion(preflight)
    preflight.add_argument("--fix", action="store_true", help="offer to set the parameters that would mend it")
    preflight.add_argument("--yes", action="store_true", help="with --fix: set them without asking")
    _add_json(preflight, "findings")


def add_status(commands: Commands) -> None:
    text = "Asks a running `guard` or `fly --connect` on this machine; see docs/how-to/flights.md."
    status = _command(commands, "status", "status:run_status", "what a running guard or flight is doing", text)
    text = "where to ask (default: this session, then the service)"
    status.add_argument("--socket", type=Path, metavar="PATH", help=text)
    _add_json(status, "status")


def add_logs(commands: Commands) -> None:
    text = "Flights that `fly --connect` and `guard` have recorded; see docs/how-to/flights.md."
    logs = commands.add_parser("logs", help="recorded flights of real vehicles: list, show, export", description=text)
    whats = logs.add_subparsers(required=True, metavar="WHAT", dest="what")
    ways = {
        "list": "every flight, the oldest first",
        "show": "what happened in a flight",
        "export": "one archive of a flight",
    }
    listed, shown, exported = (
        _command(whats, name, f"flights.command:run_{name}", text, f"{text.capitalize()}.")
        for name, text in ways.items()
    )
    for parser in (shown, exported):
        text = "its name or folder (default: last)"
        parser.add_argument("flight", nargs="?", default="last", metavar="FLIGHT", help=text)
    for parser in (listed, shown, exported):
        _add_runs(parser)
    _add_json(listed, "flights")
    _add_json(shown, "flight")
    _add_out(exported, "FILE", "the archive (default: FLIGHT.tar.gz)")
    _add_no_position(exported)


def add_report(commands: Commands) -> None:
    text = "One file that any browser opens, without a network; see docs/report.md."
    report = _command(commands, "report", "report.command:run_report", "a recorded flight as a page to look at", text)
    text = "a run's folder, or a flight's name (default: last)"
    report.add_argument("flight", nargs="?", default="last", metavar="RUN", help=text)
    _add_runs(report)
    _add_out(report, "FILE", "the page (default: report.html in the run's folder)")
    _add_no_position(report)


def add_watch(commands: Commands) -> None:
    text = "The report's page while a flight goes on; only reads its folder; see docs/report.md."
    watch = _command(commands, "watch", "report.live_server:run_watch", "a flight in a browser while it is flown", text)
    text = "the run's folder (default: that of the running guard or flight)"
    watch.add_argument("flight", nargs="?", type=Path, metavar="RUN", help=text)
    text = "where to listen (default: %(default)s, this machine alone)"
    watch.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help=text)
    watch.add_argument("--port", type=port, default=0, help="TCP port (default: any free one)")


def add_doctor(commands: Commands) -> None:
    text = "Configuration without keys, versions, machine, journal, last flights; see docs/how-to/flights.md."
    summary = "one archive for whoever is asked for help"
    doctor = _command(commands, "doctor", "flights.doctor:run_doctor", summary, text)
    out = Path("rebound-doctor.tar.gz")
    doctor.add_argument("--out", type=Path, default=out, metavar="FILE", help="the archive (default: %(default)s)")
    text = "settings beside those of /etc/rebound"
    doctor.add_argument("--config", type=Path, action="append", default=[], metavar="FILE", help=text)
    doctor.add_argument("--preflight", type=Path, metavar="FILE", help="what `rebound preflight --json` printed")
    doctor.add_argument("--flights", type=count, default=3, metavar="N", help="how many of the last (default: 3)")
    _add_runs(doctor)
    _add_no_position(doctor)


def _add_runs(parser: Parser) -> None:
    text = "where the flights are (default: runs here, or the service's)"
    parser.add_argument("--runs", type=Path, metavar="DIR", help=text)


def _add_no_position(parser: Parser) -> None:
    text = "without coordinates: no packets, no places in events and summary"
    parser.add_argument("--no-position", action="store_true", help=text)


def add_check(commands: Commands) -> None:
    text = "Validates mission files, prints what would be flown and when, and draws it."
    check = _command(
        commands, "check", "check.command:run_check", "check a mission file and show what would be flown", text
    )
    missions = "mission files, or names of ones that ship"
    check.add_argument("missions", type=mission_file, nargs="*", metavar="MISSION", help=missions)
    schema = "print the JSON schema of mission files, for editors, and nothing else"
    check.add_argument("--schema", action="store_true", help=schema)
    _add_set(check, "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5")
    _add_out(check, "DIR", "folder of the pictures (default: runs/check)", default=Path("runs/check"))
    check.add_argument("--no-picture", action="store_true", help="draw nothing")


def add_plan(commands: Commands) -> None:
    text = "Reads and writes QGroundControl's .plan files; see docs/how-to/qgroundcontrol.md."
    plan = commands.add_parser("plan", help="missions from and for QGroundControl", description=text)
    ways = plan.add_subparsers(required=True, metavar="import|export")
    text = "Makes a mission of a .plan."
    reading = _command(ways, "import", "plan.command:run_import", "a mission file from a .plan", text)
    reading.add_argument("plan", type=Path, metavar="PLAN", help="QGroundControl's file")
    reading.add_argument("--name", help="name of the mission (default: the file's)")
    _add_out(reading, "FILE", "default: standard output")
    text = "Makes a .plan of a mission."
    writing = _command(ways, "export", "plan.command:run_export", "a .plan from a mission file", text)
    writing.add_argument("mission", type=mission_file, metavar="MISSION")
    home = "where the vehicle will be armed: degrees, and metres above sea level (default 0)"
    writing.add_argument("--home", type=_home, required=True, metavar="LAT,LON[,ALT]", help=home)
    _add_out(writing, "FILE", "default: standard output")


def add_replay(commands: Commands) -> None:
    text = "The detector over a .ulg, a .tlog or a run's folder; see docs/how-to/recorded-flights.md."
    replay = _command(commands, "replay", "replay.command:run_replay", "look for collisions in a recorded flight", text)
    replay.add_argument("log", type=Path, metavar="LOG", help="a .ulg, a .tlog or a run's folder")
    replay.add_argument("--detector", metavar="NAME", help="another detector than the mission's, or than the default")
    rate = "HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    replay.add_argument("--rate", type=rate_hz, metavar="HZ", help=rate)
    _add_companion(replay)
    _add_set(replay, "change a setting, e.g. companion.fused.side_threshold_m_s2=6")
    expected = "exit 1 unless there are exactly so many collisions"
    replay.add_argument("--expect", type=_expected, metavar="none|N", help=expected)
    least = "with --expect none: exit 1 where less of the flight was watched (default 0.5: most of it was not)"
    replay.add_argument("--least-watched", type=share, default=0.5, metavar="SHARE", help=least)
    _add_out(replay, "DIR", "folder of the pictures (default: runs/replay-<name of the log>)")
    _add_json(replay, "findings")


def add_tune(commands: Commands) -> None:
    text = "Noise floor, margins, the smallest hit that would be seen, settings; see docs/how-to/recorded-flights.md."
    tune = _command(commands, "tune", "tune.command:run_tune", "settings for a vehicle from its healthy flights", text)
    logs = "flights without a collision: .ulg, .tlog or runs' folders"
    tune.add_argument("logs", type=Path, nargs="+", metavar="LOG", help=logs)
    tune.add_argument("--detector", metavar="NAME", help="default: the companion's")
    arms = "whose arms hit the wall (default: both foldable and rigid)"
    tune.add_argument("--airframe", metavar="NAME|FILE", help=arms)
    tune.add_argument("--companion", type=Path, metavar="FILE", help="settings to begin with (default: the defaults)")
    _add_out(tune, "FILE", "write the settings, for rebound fly --companion FILE")
    _add_json(tune, "figures")


def add_identify(commands: Commands) -> None:
    text = "Fits stiffness, damping and restitution to hits on a wall; see docs/how-to/airframes.md."
    identify = _command(
        commands, "identify", "identification.command:run_identify", "find an airframe's springs in recorded hits", text
    )
    data = "a CSV file, a .tlog or a run's folder: one hit each"
    identify.add_argument("data", type=Path, nargs="+", metavar="DATA", help=data)
    identify.add_argument("--mass", type=mass_kg, metavar="KG", help="of the vehicle; known for simulated runs")
    identify.add_argument("--axis", choices=("x", "y"), help="CSV: it is square to the wall (default: by the turn)")
    _add_out(identify, "FILE", "write an airframe file")
    identify.add_argument("--name", help="name of the airframe (default: the file's)")
    base = "airframe for all else (default: foldable, rigid where no spring is seen)"
    identify.add_argument("--based-on", metavar="NAME", help=base)


def add_airframe(commands: Commands) -> None:
    text = "PX4's parameters for one of our airframes, on standard output."
    airframe = _command(commands, "airframe", "airframe:run_airframe", "print an airframe for PX4", text)
    airframe.add_argument("target", choices=("px4",), help="for whom")
    airframe.add_argument("--airframe", default="foldable", metavar="NAME|FILE", help="default: foldable")
    text = "what PX4 flies by: motion capture, as indoors (default), an RTK GPS, or optical flow and a range finder"
    airframe.add_argument("--position", choices=("mocap", "gps", "flow"), default="mocap", help=text)
    text = "env: exports that PX4 SITL reads at start (default); params: for QGroundControl; airframe: for PX4"
    airframe.add_argument("--format", choices=("env", "params", "airframe"), default="env", help=text)


def add_key(commands: Commands) -> None:
    text = "The key that a vehicle and those who may command it share; see docs/how-to/security.md."
    key = _command(commands, "key", "key:run_key", "make a key for MAVLink's message signing", text)
    text = "new: make a key; px4: write it as the file that PX4 has on its SD card"
    key.add_argument("what", choices=("new", "px4"), help=text)
    key.add_argument("file", type=Path, metavar="FILE", help="the key's file")
    text = "new: ask for a passphrase, from which QGroundControl and MAVProxy make the same key (SHA-256)"
    key.add_argument("--passphrase", action="store_true", help=text)
    text = "px4: the file to write, to be copied to mavlink/ on the card (default: %(default)s)"
    key.add_argument("--card", type=Path, default=Path("mavlink-signing-key.bin"), metavar="FILE", help=text)


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
    service.add_argument("what", choices=("install", "status", "check", "uninstall"), help=text)
    how = service.add_mutually_exclusive_group()
    text = "install: guard with these settings, from boot on"
    how.add_argument("--guard", type=Path, metavar="CONFIG", help=text)
    text = "install: fly this each time somebody starts the service"
    how.add_argument("--mission", type=mission_file, metavar="FILE", help=text)
    _add_connect(service, required=False)
    service.add_argument("--dry-run", action="store_true", help="show what would be written or removed, and stop")


# In the order of `rebound --help`.
COMMANDS = (
    *(
        add_fly,
        add_guard,
        add_init,
        add_check,
        add_plan,
        add_sim,
        add_preflight,
        add_status,
        add_logs,
        add_report,
        add_watch,
    ),
    *(add_doctor, add_replay, add_tune, add_airframe, add_identify, add_key, add_completion, add_service),
)
