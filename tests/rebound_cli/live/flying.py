"""A flight in virtual time through the loop of real flights: a vehicle, a clock and a link in one."""

import math
import random
import sys
from typing import Any

from bench.fly.air import Air, Injector
from companion.companion import Companion
from rebound_cli.background import Background
from rebound_cli.inputs.inputs import load_mission_document, mission_from, resolved, world_from
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import FlightFaultError, Loop, confirm_now, fly_realtime
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder
from sim_vehicle.vehicle import SimulatedVehicle
from tests.rebound_cli.command import HOP, SQUARE

HOP_SETS = [word for word in HOP if word != "--set"]


class World(Air):
    """A connection to a simulated vehicle, and the clock: waiting for bytes lets virtual time pass."""

    def __init__(self, scene, companion):
        vehicle = SimulatedVehicle(scene.airframe, scene.scene, scene.scene.seed)
        super().__init__(vehicle, companion, Interrupts(), Injector(), random.Random(1), limit_s=math.inf)
        self.sent, self.is_deaf = [], False
        self.cut_until_s, self.told = 0.0, []  # by the connection

    def receive(self, timeout_s):
        if timeout_s > 0.0 and self.is_deaf:
            raise OSError("the driver is gone")
        return super().receive(timeout_s)

    def unplug(self):
        """Pull the plug, and put it in again 0.6 s later."""
        self.cut_until_s = self.now_s + 0.6
        self.told.append("connection to /dev/ttyACM0 lost, reconnecting")

    def news(self):
        return self.told.pop(0) if self.told else None

    def send(self, frame):
        self.sent.append(frame)
        if not self.cut_until_s:
            super().send(frame)

    def passed(self):
        frames = super().passed()
        if 0.0 < self.cut_until_s <= self.now_s:
            self.cut_until_s = 0.0
            self.told.append("connected again: /dev/ttyACM1")
        return [] if self.cut_until_s else frames


def fly(folder, stream=sys.stderr, confirm=None, computer=None):
    """A hop in virtual time through the loop of real flights."""
    document = load_mission_document(SQUARE, HOP_SETS)
    scene = world_from(document)
    mission = mission_from(document, scene)
    companion = Companion(mission)
    world: Any = World(scene, companion)
    run_folder.write_yaml(folder / run_folder.RESOLVED_NAME, resolved(mission, scene))
    run_folder.write_json(folder / run_folder.VERSIONS_NAME, {})
    run_folder.write_json(folder / run_folder.SUMMARY_NAME, {})
    recorder, console = FlightRecorder(folder, Background("log")), Console(stream, Background("console"))
    problem = None
    try:
        loop = Loop(companion, world, world, recorder, console, Interrupts(), None, computer)
        fly_realtime(companion, loop, confirm_now if confirm is None else confirm(world))
    except FlightFaultError as error:
        problem = str(error)
    recorder.close()
    return companion, world, recorder, console, problem
