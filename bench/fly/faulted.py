"""One flight into a wall with a fault, through the loop of real flights in virtual time."""

from __future__ import annotations

import io
import math
import random
from pathlib import Path
from typing import Any

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import across, there
from bench.fly.air import KILLED, Air, Fault, Hung, Injector, Killed
from companion.companion import Companion, StepResult
from companion.mission.model import Mission
from companion.shell.tlog import may_be_logged
from rebound_cli.inputs.inputs import resolved, with_guards
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import FlightFaultError, Loop, confirm_now, fly_realtime
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

SPEEDS_M_S, MOST_SLANT_DEG = (1.0, 2.0), 30.0
HEIGHT_M, WALL_M = 1.0, 2.0
# The mission takes 20 s; links that are cut are given up after some seconds.
LIMIT_S = 60.0
# What an aborted flight leaves hovers, or comes down by itself from this height within 12 s.
LEFT_ALONE_S, KILLED_FOR_S = 1.5, 12.0


class Noting(FlightRecorder):
    """Keeps the vehicle's time of every event: the companion's own clock may be what is wrong."""

    def __init__(self, folder: Path, air: Air) -> None:
        super().__init__(folder)
        self.folder, self._air = folder, air
        self.told_s: list[float] = []
        self.counted = 0

    def record(self, now_us: int, result: StepResult) -> None:
        self.told_s += [self._air.now_s] * len(result.events)
        self.counted += sum(map(may_be_logged, result.received_frames)) + len(result.sent_frames)
        super().record(now_us, result)


def mission_of(number: int) -> Mission:
    """Up, into a wall that nobody knows of, and down."""
    chance = random.Random(number)
    speed, slant = round(chance.uniform(*SPEEDS_M_S), 2), math.radians(chance.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG))
    go_to = {"position_ned_m": [7, 0, -HEIGHT_M], "speed_m_s": speed, "acceleration_m_s2": 2.0}
    data: dict[str, Any] = {
        "name": "faults",
        "items": there(HEIGHT_M, go_to),
        "on_collision": {"then": "land"},
        "on_interrupt": "hold",
        "fence": {"radius_m": 12, "max_height_m": 4},
        "companion": {"streams": {"window_s": 0.5}},
        "sim": {"walls": [across(WALL_M, slant, 20, 5)], "airframe": AIRFRAMES[number % 2], "seed": 1 + number},
    }
    return Mission.model_validate(with_guards(data, load_built_in(AIRFRAMES[number % 2])))


class FaultedFlight:
    """The mission of a number with a fault. Files are left in the folder of `recorder`."""

    def __init__(self, number: int, fault: Fault, folder: Path) -> None:
        self.number, self.fault = number, fault
        self.mission = mission_of(number)
        self.scene = Scene.model_validate(self.mission.sim or {})
        self.airframe = load_built_in(self.scene.airframe)
        self.injector = fault.inject(self._chance())
        vehicle = SimulatedVehicle(self.airframe, self.scene, self.scene.seed, links_may_fail=True)
        self.interrupts, self.companion = Interrupts(), Companion(self.mission)
        self.air = Air(vehicle, self.companion, self.interrupts, Injector(), self._chance(), LIMIT_S)
        if fault.from_the_start:
            self._begin()
        else:
            self.air.at_first_item = self._begin
        self.fault_text, self.ended = "", ""
        """What the loop says of a fault inside the program; how the flight ended if not by its mission's rules."""
        self.killed_at_s = 0.0
        run_folder.write_yaml(folder / run_folder.RESOLVED_NAME, resolved(self.mission, None))
        run_folder.write_json(folder / run_folder.VERSIONS_NAME, {})
        run_folder.write_json(folder / run_folder.SUMMARY_NAME, {})
        self.recorder = Noting(folder, self.air)

    def fly(self) -> None:
        air, console = self.air, Console(io.StringIO())
        try:
            clock: Any = air
            loop = Loop(self.companion, air, clock, self.recorder, console, self.interrupts)
            fly_realtime(self.companion, loop, confirm_now)
        except FlightFaultError as error:
            self.fault_text = str(error)
        except (Killed, Hung) as end:
            self.ended = {Killed: KILLED, Hung: "hung"}[type(end)]
        self.killed_at_s = air.now_s
        air.alone(KILLED_FOR_S if self.ended == KILLED else LEFT_ALONE_S)
        if self.ended == KILLED:
            # What a killed process had in memory is gone; what it had given to the system is not.
            self.recorder._tlog._pending.clear()
        self.recorder.close()

    def _chance(self) -> random.Random:
        return random.Random(f"{self.fault.name} {self.number}")

    def _begin(self) -> None:
        """From here on this is a flight with that fault."""
        if not self.fault.expected.has_wall:
            self.air.vehicle.remove(self.air.vehicle.obstacles)
        self.air.injector = self.injector
        if self.injector.has_pilot:
            self.air.add_pilot()
