"""A mission flown in lockstep through the whole wire, and what is known of the flight afterwards."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from companion.mission.model import Mission
from companion.report import Event, FlightReport
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.summary import Flown
from rebound_cli.results.truth_match import FlightTruth, Vector3
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import Airframe
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from sim_vehicle.world import Obstacle

# The slowest hit into a surface that a detector's bars promise to find.
NOTICED_M_S = 0.5
# Closer than this to how it stands, a vehicle is on the ground.
STANDS_M = 0.03


@dataclass(frozen=True, slots=True)
class JudgedFlight:
    """What a judge may look at: the mission, what the companion told, what really happened."""

    mission: Mission
    report: FlightReport
    events: Sequence[Event]
    truth: FlightTruth
    start_ned_m: Vector3 = (0.0, 0.0, 0.0)
    standing_m: float = 0.08
    """Height of the centre when the vehicle stands on the ground."""
    arm_m: float = 0.0
    """From the centre to a motor's axis, about which a guard goes round with `guard_m`."""
    guard_m: float = 0.0
    obstacles: Mapping[str, Obstacle] = field(default_factory=dict)
    """By name."""

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
        flown, _ = fly_mission_lockstep(mission, SimulatedVehicle(airframe, scene, scene.seed), recorder, Interrupts())
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
    return judged_flight(mission, flown.report, events, flown.truth, scene, airframe)


def judged_flight(
    mission: Mission,
    report: FlightReport,
    events: Sequence[Event],
    truth: FlightTruth,
    scene: Scene,
    airframe: Airframe,
) -> JudgedFlight:
    frame = airframe.geometry
    parts = frame.foot_depth_m, frame.motor_radius_m, frame.guard_radius_m
    obstacles = {obstacle.name: obstacle for _, obstacle in scene.obstacles()}
    return JudgedFlight(mission, report, events, truth, scene.start.position_ned_m, *parts, obstacles)
