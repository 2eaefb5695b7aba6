"""`rebound sim`: the simulated vehicle alone, in real time, for any MAVLink client."""

import os
import signal
import threading
import time
from argparse import Namespace
from functools import partial
from pathlib import Path

from companion.errors import ConfigurationError
from companion.shell.signing_files import read_key
from rebound_cli.background import Background
from rebound_cli.inputs.inputs import SimulatedWorld, load_world
from rebound_cli.live.console import Console, console_for
from rebound_cli.results.ending import impact_text
from rebound_cli.simulation.compiling import prepare_vehicle
from rebound_cli.simulation.vehicle_process import READY_WORDS
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.parameters.store import time_outs_at
from sim_vehicle.shell.addresses import COMPANION_PORT, GROUND_PORT, open_port, px4_ports
from sim_vehicle.shell.realtime import serve
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle


def run_sim(options: Namespace) -> None:
    """Serve until Ctrl-C or SIGTERM, or until stdin closes when the caller wants to be outlived by nobody."""
    stopped = threading.Event()
    if options.truth is not None:
        _check_place(options.truth)
    is_px4 = options.autopilot == "px4"
    for option in ("signing-key", "remote", "link") if is_px4 else ("host", "sensor-rate"):
        if getattr(options, option.replace("-", "_")):
            whose = "the built-in autopilot" if is_px4 else "--autopilot px4"
            raise ConfigurationError(f"--{option} belongs to {whose}: leave it out here.")
    world = load_world(options.mission, options.set, options.airframe, options.seed)
    # On a thread of its own: a vehicle does not stand still in the air because nobody reads what is printed.
    with console_for(False, Background("console")) as console:
        # Before Ctrl-C means an end in good order: until then there is nothing to end.
        prepare_vehicle(console, world)
        console.still()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: stopped.set())
        if options.stop_with_stdin:
            threading.Thread(target=_wait_for_end_of_stdin, args=(stopped,), daemon=True).start()
        serve_it = _serve_px4 if is_px4 else _serve_builtin
        serve_it(options, world, stopped, console)


def _tell_of(console: Console, hit: Hit) -> None:
    text = f"{impact_text(hit.kind, hit.impact_velocity_ned_m_s)}, {hit.peak_force_n:.0f} N"
    console.event(hit.contact_at_boot_us / 1e6, "hit", text)


def _check_place(truth: Path) -> None:
    """Before hours are simulated of which nothing could be kept."""
    if not truth.parent.is_dir():
        raise ConfigurationError(f"--truth {truth}: there is no folder {truth.parent}.")
    if truth.is_dir() or not os.access(truth if truth.exists() else truth.parent, os.W_OK):
        raise ConfigurationError(f"--truth {truth}: this cannot be written to; give another file.")


def _serve_builtin(options: Namespace, world: SimulatedWorld, stopped: threading.Event, console: Console) -> None:
    key = None if options.signing_key is None else read_key(options.signing_key)
    parameters = {"MAV_SYS_ID": options.instance + 1, **time_outs_at(options.speed)}
    parameters |= {} if key is None else {"MAV_SIGN_CFG": 1.0}
    epoch_us = time.time_ns() // 1000
    vehicle = SimulatedVehicle(world.airframe, world.scene, world.scene.seed, True, epoch_us, parameters, Signing(key))
    vehicle.truth.on_hit = partial(_tell_of, console)
    remote = options.remote or ("127.0.0.1", COMPANION_PORT + options.instance)
    ports = px4_ports(vehicle, options.instance, options.port, remote)
    ports += [open_port(vehicle, address) for address in options.link]
    host, port = remote
    console.print(f"""{READY_WORDS} '{world.airframe.name}': MAVLink to {host}:{port} over UDP. Ctrl-C stops it.
  QGroundControl  finds it by itself, at UDP port {GROUND_PORT}
  MAVSDK          udpin://0.0.0.0:{port}
  mavutil         udpin:0.0.0.0:{port}
  Rebound         --connect udpin://0.0.0.0:{port}""")
    serve(vehicle, ports, options.truth, stopped.is_set, options.speed)


def _serve_px4(options: Namespace, world: SimulatedWorld, stopped: threading.Event, console: Console) -> None:
    # Here, because most vehicles have an autopilot of their own and are to start at once.
    from sim_vehicle.hil.messages import MOTORS_STOPPED
    from sim_vehicle.hil.vehicle import HilVehicle
    from sim_vehicle.shell.hil_tcp import PX4_SIMULATOR_PORT, serve_px4

    def new_vehicle() -> HilVehicle:
        vehicle = HilVehicle(world.airframe, world.scene, world.scene.seed, 1_000_000 // (options.sensor_rate or 1000))
        vehicle.truth.on_hit = partial(_tell_of, console)
        return vehicle

    # Compiled, or loaded from numba's cache, before PX4 waits for it.
    new_vehicle().step(MOTORS_STOPPED)
    console.print(f"Body of '{world.airframe.name}' for PX4. Ctrl-C stops it.")
    port = PX4_SIMULATOR_PORT + options.instance if options.port is None else options.port
    host = options.host or "127.0.0.1"
    serve_px4(new_vehicle, port, options.speed, options.truth, stopped.is_set, console.print, host)


def _wait_for_end_of_stdin(stopped: threading.Event) -> None:
    """The pipe's other end closes when the caller closes it or dies, however it dies."""
    # Not sys.stdin: a thread inside its lock when the program ends with an error would abort the interpreter.
    while os.read(0, 1024):
        pass
    stopped.set()
