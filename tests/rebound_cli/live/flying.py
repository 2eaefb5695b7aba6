"""A flight in virtual time through the loop of real flights: a vehicle, a clock and a link in one."""

import sys
from functools import partial
from typing import Any

from companion.companion import Companion
from rebound_cli.background import Background
from rebound_cli.inputs.inputs import load_mission_document, mission_from, resolved, world_from
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import ConfirmAtOnce, FlightFaultError, Loop, fly_realtime
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder
from sim_vehicle.vehicle import SimulatedVehicle
from tests.rebound_cli.command import HOP, SQUARE

EPOCH_US = 1_600_000_000_000_000
HOP_SETS = [word for word in HOP if word != "--set"]


class World:
    """A connection to a simulated vehicle, and the clock: waiting for bytes lets virtual time pass."""

    def __init__(self, scene):
        self.vehicle = SimulatedVehicle(scene.airframe, scene.scene, scene.scene.seed)
        self.sent, self.custom_mode, self.is_deaf = [], None, False
        self.cut_until_us, self.told = 0, []  # by the connection
        self._pending, self._readings = b"", 0

    def now_us(self):
        # A clock that is read goes on.
        self._readings += 1
        return EPOCH_US + self.vehicle.time_boot_us + 4 * self._readings

    def sleep(self, duration_s):
        until_us = self.now_us() + duration_s * 1e6
        while self.now_us() < until_us:
            self._pass()

    def receive(self, timeout_s):
        if timeout_s > 0.0 and self.is_deaf:
            raise OSError("the driver is gone")
        return self._pass() if timeout_s > 0.0 else b""

    def unplug(self):
        """Pull the plug, and put it in again 0.6 s later."""
        self.cut_until_us = self.vehicle.time_boot_us + 600_000
        self.told.append("connection to /dev/ttyACM0 lost, reconnecting")

    def news(self):
        return self.told.pop(0) if self.told else None

    def send(self, frame):
        self.sent.append(frame)
        self._pending += b"" if self.cut_until_us else frame

    def _pass(self):
        frames = self.vehicle.step(self._pending)
        self._pending = b""
        for frame in frames:
            if frame[7:10] == b"\0\0\0":  # HEARTBEAT
                self.custom_mode = int.from_bytes(frame[10:14], "little")
        if 0 < self.cut_until_us <= self.vehicle.time_boot_us:
            self.cut_until_us = 0
            self.told.append("connected again: /dev/ttyACM1")
        return b"" if self.cut_until_us else b"".join(frames)


def fly(folder, stream=sys.stderr, confirm=None, computer=None, followed=None, mission_file=SQUARE):
    """A hop in virtual time through the loop of real flights."""
    document = load_mission_document(mission_file, HOP_SETS if mission_file == SQUARE else ())
    scene = world_from(document)
    mission = mission_from(document, scene)
    companion = Companion(mission)
    world: Any = World(scene)
    run_folder.write_yaml(folder / run_folder.RESOLVED_NAME, resolved(mission, scene))
    run_folder.write_json(folder / run_folder.VERSIONS_NAME, {})
    run_folder.write_json(folder / run_folder.SUMMARY_NAME, {})
    recorder, console = FlightRecorder(folder, Background("log")), Console(stream, Background("console"))
    confirmation = ConfirmAtOnce() if confirm is None else confirm(world)
    problem = None
    try:
        loop = Loop(companion, world, world, recorder, console, Interrupts(), None, computer)
        loop.step = None if followed is None else partial(followed.step, companion)
        fly_realtime(companion, loop, confirmation)
    except FlightFaultError as error:
        problem = str(error)
    recorder.close()
    return companion, world, recorder, console, problem
