"""`rebound sim`: the simulated vehicle alone, in real time, for any MAVLink client."""

import signal
import sys
import threading
from argparse import Namespace

from rebound_cli.inputs import load_world
from rebound_cli.vehicle_process import READY_WORDS
from sim_vehicle.shell.udp import serve
from sim_vehicle.vehicle import SimulatedVehicle


def run_sim(options: Namespace) -> int:
    """Serve until Ctrl-C or SIGTERM, or until stdin closes when the caller wants to be outlived by nobody."""
    world = load_world(options.mission, options.set, options.airframe, options.seed)
    vehicle = SimulatedVehicle(world.airframe, world.scene, world.seed)
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    if options.stop_with_stdin:
        threading.Thread(target=_wait_for_end_of_stdin, args=(stopped,), daemon=True).start()
    host, port = options.remote
    print(
        f"{READY_WORDS} '{world.airframe.name}': MAVLink to {host}:{port} over UDP. Ctrl-C stops it.",
        flush=True,
    )
    serve(vehicle, options.port, options.remote, options.truth, stopped.is_set)
    return 0


def _wait_for_end_of_stdin(stopped: threading.Event) -> None:
    """The pipe's other end closes when the caller closes it or dies, however it dies."""
    while sys.stdin.buffer.read(1024):
        pass
    stopped.set()
