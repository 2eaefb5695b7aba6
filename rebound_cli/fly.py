"""`rebound fly`: one mission from file to summary, on a connection, a simulated vehicle or in lockstep."""

import json
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from companion.companion import Companion
from companion.errors import ConfigurationError, ReboundError
from companion.mission.model import Mission
from companion.shell.clock import Clock
from companion.shell.connections.connection import Connection, udp_in
from companion.shell.files import write_whole
from rebound_cli.background import Background
from rebound_cli.flights.kept import folder_with_room
from rebound_cli.inputs import inputs
from rebound_cli.live.console import Console, console_for
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import AskPerson, Computer, FlightFaultError, Loop, confirm_now, fly_realtime, watched
from rebound_cli.live.signed_connection import open_signed, refused_packets, unheard_text
from rebound_cli.live.status import StatusServer, served
from rebound_cli.report.showing import offer_page, show_flight, watched_page
from rebound_cli.results import run_folder
from rebound_cli.results.ending import ending_text
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.summary import Flown, build_summary
from rebound_cli.results.truth_match import read_truth

if TYPE_CHECKING:
    from sim_vehicle.shell.json_udp import ArduPilotVehicle
    from sim_vehicle.vehicle import SimulatedVehicle

# Where PX4's SITL sends its onboard streams unasked, plus its instance.
PX4_COMPANION_PORT = 14540


@dataclass(frozen=True, slots=True)
class Flight:
    mission: Mission
    world: inputs.SimulatedWorld | None
    folder: Path
    recorder: FlightRecorder
    console: Console
    interrupts: Interrupts


def run_fly(options: Namespace) -> int:
    """Fly, write the run folder, tell the person. 0 only when the mission was completed."""
    is_simulated = options.connect is None
    if options.instance and (options.sim not in ("px4", "ardupilot") or not is_simulated):
        raise ConfigurationError("--instance belongs to --sim px4 and --sim ardupilot: leave it out here.")
    if not is_simulated and (options.airframe is not None or options.seed is not None):
        raise ConfigurationError("--airframe and --seed belong to simulated vehicles: leave them out with --connect.")
    for option in ("signing-key", "peer", "wait") if is_simulated else ():
        if getattr(options, option.replace("-", "_")):
            raise ConfigurationError(f"--{option} belongs to --connect: leave it out where the vehicle is simulated.")
    given = (options.airframe, options.seed, options.companion)
    document = inputs.load_mission_document(options.mission, options.set, *given)
    if options.wait:
        document.put_option("--wait", ("companion", "link", "wait"), True)
    if options.obstacles is not None:
        document.put_option("--obstacles", ("obstacles", "file"), str(options.obstacles))
    world = inputs.world_from(document) if is_simulated else None
    mission = inputs.mission_from(document, world)
    if options.resume is not None:
        inputs.resume(document, options.resume, mission, knows_more=options.obstacles is None)
        mission = inputs.mission_from(document, world)
    if mission.companion.link.wait and options.yes:
        raise ConfigurationError("--wait with --yes would arm a vehicle whenever it appears: leave one of them out.")
    if options.watch and (options.lockstep or options.sim == "ardupilot"):
        raise ConfigurationError("--watch belongs to flights in real time: this one's page is its report.html.")
    run_folder.check_place(options.out)
    with console_for(options.json, Background("console")) as console:
        is_lockstep = is_simulated and (options.lockstep or options.sim == "ardupilot")
        if world is not None and is_lockstep:
            from rebound_cli.simulation.compiling import prepare_vehicle

            prepare_vehicle(console, world)
        # The address is tried before anything is written: a wrong one leaves no empty folder behind.
        connection = None if is_simulated else open_signed(options, mission.companion.link.wait)
        if is_simulated and options.sim == "px4":
            connection = udp_in("0.0.0.0", PX4_COMPANION_PORT + options.instance)
        if is_simulated:
            folder, ring = run_folder.create_run_folder(options.out, mission.name), None
        else:
            folder, ring = folder_with_room(options.out, mission.name, mission.companion.disk)
        _write_inputs(folder, options.mission, mission, world)
        # In lockstep the vehicle waits for the disk as for everything else.
        recorder = FlightRecorder(folder, None if is_lockstep else Background("log"), ring.make_room if ring else None)
        with watched_page(folder, console, options.watch), Interrupts() as interrupts:
            flight = Flight(mission, world, folder, recorder, console, interrupts)
            try:
                with closing(recorder):
                    flown = _fly(flight, connection, options)
            except BaseException:
                if interrupts.reason is not None and not (folder / run_folder.TLOG_NAME).stat().st_size:
                    _forget(folder, options.mission)
                raise
        return _finish(flight, flown, options.json)


def _fly(flight: Flight, connection: Connection | None, options: Namespace) -> Flown:
    world = flight.world
    if world is not None and options.lockstep:
        from sim_vehicle.vehicle import SimulatedVehicle

        return _fly_stepped(flight, SimulatedVehicle(world.airframe, world.scene, world.scene.seed))
    if world is not None and options.sim == "ardupilot":
        return _fly_ardupilot(flight, world, options.instance)
    if world is not None:
        return _fly_beside_vehicle(flight, connection, options.instance)
    assert connection is not None, "--connect has one"
    confirm = partial(confirm_now, console=flight.console) if options.yes else AskPerson(flight.console).poll
    operator = flight.mission.companion.operator
    with (
        served(flight.console.print, command="fly", folder=str(flight.folder.resolve())) as server,
        watched(flight.folder, operator.computer_status) as computer,
    ):
        return _fly_connected(flight, connection, confirm, server, computer)


def _write_inputs(folder: Path, mission_file: Path, mission: Mission, world: inputs.SimulatedWorld | None) -> None:
    copy = folder / run_folder.MISSION_NAME
    if mission_file.resolve() != copy.resolve():
        if copy.exists():
            raise ConfigurationError(f"{copy} is another mission: give --out another folder.")
        write_whole(copy, mission_file.read_bytes())
    run_folder.write_yaml(folder / run_folder.RESOLVED_NAME, inputs.resolved(mission, world))
    run_folder.write_json(folder / run_folder.VERSIONS_NAME, run_folder.versions())
    if world is not None:
        run_folder.write_yaml(folder / run_folder.AIRFRAME_NAME, world.airframe.model_dump(mode="json"))


def _forget(folder: Path, mission_file: Path) -> None:
    """What was ended before a vehicle was there is no flight. A file that a person flies from there stays."""
    names = (run_folder.MISSION_NAME, run_folder.RESOLVED_NAME, run_folder.AIRFRAME_NAME, run_folder.VEHICLE_LOG_NAME)
    run_folder.forget(folder, *(name for name in names if (folder / name).resolve() != mission_file.resolve()))


def _fly_connected(
    flight: Flight,
    connection: Connection,
    confirm: Callable[[Companion], None],
    server: StatusServer | None = None,
    computer: Computer | None = None,
) -> Flown:
    companion, started_s, fault = Companion(flight.mission), time.monotonic(), None
    loop = Loop(companion, connection, Clock(), flight.recorder, flight.console, flight.interrupts, server, computer)
    try:
        fly_realtime(companion, loop, confirm)
    except FlightFaultError as error:
        # What is known of the flight is written first.
        fault = error
    finally:
        connection.close()
    duration_s, refused = time.monotonic() - started_s, refused_packets(connection)
    return Flown(companion.report(), duration_s, None, loop.timing, refused, connection.counts, fault)


def _fly_beside_vehicle(flight: Flight, px4: Connection | None, instance: int) -> Flown:
    """A simulated vehicle of our own; or its body, for the PX4 that the person starts, at the connection `px4`."""
    from rebound_cli.simulation.vehicle_process import READY_WORDS, VehicleProcess

    waits = ""
    if px4 is None:
        own, words = udp_in("127.0.0.1", 0), READY_WORDS
        # The companion keeps to the clock, whatever PX4_SIM_SPEED_FACTOR says.
        options = ["--port", "0", "--remote", f"127.0.0.1:{own.local_port}", "--speed", "1"]
    else:
        from sim_vehicle.hil.exchange import FIRST_ANSWER_WORDS
        from sim_vehicle.shell.hil_tcp import PX4_SIMULATOR_PORT

        port, words = PX4_SIMULATOR_PORT + instance, FIRST_ANSWER_WORDS
        options = ["--autopilot", "px4", "--port", str(port)]
        waits = f"Waiting for PX4 to connect to the simulator at TCP port {port} (docs/how-to/px4.md) ..."
    flown: Flown | None = None
    try:
        with VehicleProcess(flight.folder, options, words) as vehicle:
            if waits:
                flight.console.print(waits)
            vehicle.wait_until_ready(flight.interrupts, flight.console)
            # What PX4 said while it booted is old.
            while px4 is not None and px4.receive(0):
                pass
            flown = _fly_connected(flight, px4 or own, confirm_now)
            vehicle.check_running()
        vehicle.check_ended_well()
        return replace(flown, truth=read_truth(flight.folder / run_folder.TRUTH_NAME))
    except ReboundError as error:
        if flown is None:
            raise
        # What is known of the flight is written first, without a truth.
        return replace(flown, fault=flown.fault or error)


def _fly_ardupilot(flight: Flight, world: inputs.SimulatedWorld, instance: int) -> Flown:
    """The body of the vehicle, for the ArduPilot that the person starts."""
    from sim_vehicle.json.vehicle import JsonVehicle
    from sim_vehicle.shell.json_udp import MAVLINK_PORT, PORTS_APART, ArduPilotVehicle

    port = MAVLINK_PORT + PORTS_APART * instance
    body = JsonVehicle(world.airframe, world.scene, world.scene.seed)
    flight.console.print(f"Waiting for ArduPilot's SITL at TCP port {port} (docs/how-to/ardupilot.md) ...")

    with ArduPilotVehicle(body, instance, lambda: flight.interrupts.reason is not None) as vehicle:
        vehicle.start()
        return _fly_stepped(flight, vehicle)


def _fly_stepped(flight: Flight, vehicle: "SimulatedVehicle | ArduPilotVehicle") -> Flown:
    from rebound_cli.simulation.lockstep import EPOCH_US, fly_mission_lockstep
    from sim_vehicle.shell.truth_file import save_truth

    flown = fly_mission_lockstep(flight.mission, vehicle, flight.recorder, flight.interrupts, flight.console)
    save_truth(flight.folder / run_folder.TRUTH_NAME, vehicle.truth, EPOCH_US)
    return flown


def _finish(flight: Flight, flown: Flown, json_on_stdout: bool) -> int:
    world = flight.world
    airframe, seed = (world.airframe.name, world.scene.seed) if world else (None, None)
    settled_s = flight.mission.companion.settled.duration_s
    summary = build_summary(flown, settled_s, flight.mission.name, airframe, seed)
    console, writer = flight.console, flight.recorder.writer
    if flown.timing is None:
        # In real time each was printed as it happened.
        console.events(flight.recorder.events, flown.report.started_at_us)
    console.still()
    unheard = "" if flown.report.stream_rates_hz else unheard_text(flown.refused_packets)
    console.print(f"\n{ending_text(summary)}{unheard}")
    if writer is not None and writer.loss is not None:
        console.print(f"\n{writer.loss} ({writer.lost} steps)")
    try:
        run_folder.write_json(flight.folder / run_folder.SUMMARY_NAME, summary)
        if world is not None:
            show_flight(flight.folder, console)
        else:
            offer_page(flight.folder, console)
        console.print(f"\nEverything is in {flight.folder}/")
    finally:
        if json_on_stdout:
            print(json.dumps(summary, indent=2))
    if flown.fault is not None:
        raise flown.fault
    return 0 if summary["outcome"] == "completed" else 1
