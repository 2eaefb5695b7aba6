"""The flight that is measured, and what machines are compared by."""

import gc
import statistics
import tempfile
from pathlib import Path
from time import perf_counter_ns, process_time

from pymavlink.dialects.v20 import development as dialect

from bench.fly.lockstep import flown_in
from bench.stamps import ROOT
from rebound_cli.inputs import load_mission_document, mission_from, world_from

MISSION = ROOT / "missions" / "wall.yaml"
_REPEATS = 2000


def fly() -> tuple[float, float]:
    """One flight as `rebound fly wall --lockstep` flies it, with its log: virtual time over wall clock, and over what
    this process had of a processor.
    """
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    with tempfile.TemporaryDirectory() as folder:
        # What flights before have left is not this one's.
        gc.collect()
        mission, begun_s = mission_from(document, world), process_time()
        flown, _, _ = flown_in(Path(folder), mission, world.scene, world.airframe)
        processor_s = process_time() - begun_s
    virtual_s = (flown.report.ended_at_us - flown.report.started_at_us) * 1e-6
    return virtual_s / flown.wall_clock_s, virtual_s / processor_s


def parse_us(repeats: int = _REPEATS) -> float:
    """One HIGHRES_IMU through pymavlink's own parser, whose checksum is fastcrc's: median microseconds."""
    link = dialect.MAVLink(None, 1, 1)
    force, rates, field, air = (0.1, -0.2, -9.8), (0.01, 0.02, -0.03), (0.2, 0.0, 0.4), (950.0, 0.0, 490.0, 20.0)
    packet = bytes(dialect.MAVLink_highres_imu_message(12_345_678, *force, *rates, *field, *air, 0x3F, 0).pack(link))
    spent = []
    for _ in range(repeats):
        begun = perf_counter_ns()
        link.parse_buffer(packet)
        spent.append(perf_counter_ns() - begun)
    return statistics.median(spent) / 1e3
