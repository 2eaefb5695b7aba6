"""One random mission flown in lockstep, and what is known of the flight afterwards."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bench.random_missions.generator import MissionCase, RandomMission, airframe_of
from companion.mission.model import Mission
from companion.report import Event, FlightReport
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.truth_match import FlightTruth, Vector3
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.scene import Scene
from sim_vehicle.world import Obstacle


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


def fly(case: MissionCase, drawn: RandomMission) -> JudgedFlight:
    """From take-off to the end, through the whole wire; nothing is kept but what is returned."""
    with tempfile.TemporaryDirectory() as name:
        return fly_in(Path(name), case, drawn)


def fly_in(folder: Path, case: MissionCase, drawn: RandomMission) -> JudgedFlight:
    """The same; log and events are left in the folder."""
    airframe = airframe_of(case)
    mission = Mission.model_validate(with_guards(drawn.data, airframe))
    scene = Scene.model_validate(drawn.data["sim"])
    recorder = FlightRecorder(folder)
    try:
        flown, _ = fly_mission_lockstep(mission, SimulatedWorld(scene, airframe), recorder, Interrupts())
    finally:
        recorder.close()
    assert flown.truth is not None, "a lockstep flight has its truth"
    frame = airframe.geometry
    parts = frame.foot_depth_m, frame.motor_radius_m, frame.guard_radius_m
    start, obstacles = scene.start.position_ned_m, {obstacle.name: obstacle for _, obstacle in scene.obstacles()}
    return JudgedFlight(mission, flown.report, tuple(recorder.events), flown.truth, start, *parts, obstacles)
