"""The flight that is measured."""

import gc
import tempfile
from pathlib import Path
from time import process_time

from rebound_cli.inputs import load_mission_document, mission_from, world_from
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.simulation.lockstep import fly_mission_lockstep

MISSION = Path(__file__).parents[2] / "missions/wall.yaml"


def fly() -> tuple[float, float]:
    """One flight as `rebound fly wall --lockstep` flies it, with its log: virtual time over wall clock, and over what
    this process had of a processor.
    """
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    with tempfile.TemporaryDirectory() as folder:
        recorder = FlightRecorder(Path(folder))
        # What flights before have left is not this one's.
        gc.collect()
        mission, begun_s = mission_from(document, world), process_time()
        flown, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
        processor_s = process_time() - begun_s
        recorder.close()
    virtual_s = (flown.report.ended_at_us - flown.report.started_at_us) * 1e-6
    return virtual_s / flown.wall_clock_s, virtual_s / processor_s
