"""One flight of the corpus: a random mission by a drawn vehicle, as a run folder of wire bytes and truth."""

import shutil
from pathlib import Path

from bench.random_missions.generator import MissionCase, airframe_of, random_mission
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, resolved, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import RESOLVED_NAME, TRUTH_NAME, FlightRecorder, write_yaml
from rebound_cli.simulation.lockstep import EPOCH_US, fly_mission_lockstep
from sim_vehicle.scene import Scene
from sim_vehicle.shell.truth_file import save_truth


def record(place: tuple[Path, MissionCase]) -> None:
    """Fly it into the folder, unless that is there; one that is there is whole."""
    folder, case = place
    if folder.exists():
        return
    drawn = random_mission(case)
    world = SimulatedWorld(Scene.model_validate(drawn.data["sim"]), airframe_of(case))
    mission = Mission.model_validate(with_guards(drawn.data, world.airframe))
    unfinished = folder.with_suffix(".unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    recorder = FlightRecorder(unfinished)
    try:
        _, truth = fly_mission_lockstep(mission, world, recorder, Interrupts())
    finally:
        recorder.close()
    write_yaml(unfinished / RESOLVED_NAME, resolved(mission, world))
    save_truth(unfinished / TRUTH_NAME, truth, EPOCH_US)
    unfinished.rename(folder)
