"""Flights in lockstep through the whole wire: a mission with its log, for a judge; or programs step by step."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.fly.virtual_time import VirtualTime
from companion.companion import Companion, StepResult
from companion.guard.guard import Guard
from companion.mission.model import Mission
from companion.report import Event, FlightReport
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.summary import Flown
from rebound_cli.results.truth_match import FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US, fly_mission_lockstep
from sim_vehicle.airframe import Airframe
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from sim_vehicle.world import Obstacle

Floats = npt.NDArray[np.float64]
# The slowest hit into a surface that a detector's bars promise to find.
NOTICED_M_S = 0.5
# Closer than this to how it stands, a vehicle is on the ground.
STANDS_M = 0.03


@dataclass(frozen=True, slots=True)
class JudgedFlight:
    """What a judge may look at: the mission, what the companion told, what really happened, in which world, to whom."""

    mission: Mission
    report: FlightReport
    events: Sequence[Event]
    truth: FlightTruth
    scene: Scene
    airframe: Airframe

    @property
    def obstacles(self) -> dict[str, Obstacle]:
        """By name."""
        return {obstacle.name: obstacle for _, obstacle in self.scene.obstacles()}

    @property
    def start_ned_m(self) -> Floats:
        """In the world, on the ground."""
        return np.array(self.scene.start.position_ned_m)

    @property
    def standing_m(self) -> float:
        """Height of the centre when the vehicle stands on the ground."""
        return self.airframe.geometry.foot_depth_m

    def boot_us(self, event: Event) -> float:
        return event.time_us - self.truth.epoch_at_boot_us

    def at(self, boot_us: float) -> str:
        """In words, by the companion's own time."""
        return f"at {1e-6 * (boot_us + self.truth.epoch_at_boot_us - self.report.started_at_us):.2f} s"

    def row_at(self, boot_us: float) -> int:
        """Of the truth's series."""
        times_us = self.truth.series["time_boot_us"]
        return min(int(np.searchsorted(times_us, boot_us)), len(times_us) - 1)


def flown_in(folder: Path, mission: Mission, scene: Scene, airframe: Airframe) -> tuple[Flown, Sequence[Event]]:
    """From take-off to the end, log and events left in the folder."""
    recorder = FlightRecorder(folder)
    try:
        flown = fly_mission_lockstep(mission, SimulatedVehicle(airframe, scene, scene.seed), recorder, Interrupts())
    finally:
        recorder.close()
    return flown, tuple(recorder.events)


def fly(mission: Mission, scene: Scene, airframe: Airframe, folder: Path | None = None) -> JudgedFlight:
    """The same, for a judge. With copies of the process, which must not remove it, the folder is given."""
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return fly(mission, scene, airframe, Path(name))
    flown, events = flown_in(folder, mission, scene, airframe)
    assert flown.truth is not None, "a lockstep flight has its truth"
    return JudgedFlight(mission, flown.report, events, flown.truth, scene, airframe)


class Stepped(VirtualTime):
    """A simulated vehicle and programs, each on a link of its own, without a log: all bytes both ways."""

    def __init__(self, vehicle: SimulatedVehicle, *programs: Companion | Guard) -> None:
        self.vehicle, self.programs = vehicle, programs
        self.links = [vehicle.add_link(LinkKind.ONBOARD) for _ in programs]
        self.events = []

    @property
    def state(self) -> str:
        return str(self.programs[0].status().state)

    def step(self) -> list[StepResult]:
        """One interval; what each program made of it, where there was something to hear or to send."""
        self.vehicle.advance()
        now_us, results = EPOCH_US + self.vehicle.time_boot_us, []
        for program, link in zip(self.programs, self.links, strict=True):
            heard = b"".join(link.take())
            if heard or now_us >= program.next_deadline_us():
                result = program.step(heard, now_us)
                link.push(b"".join(result.sent_frames))
                self.events += result.events
                results.append(result)
        return results

    def step_alone(self, told: bytes = b"") -> bytes:
        """One interval in which nobody answers; what the vehicle, told no more than this, said to the first."""
        self.links[0].push(told)
        self.vehicle.advance()
        return b"".join(self.links[0].take())
