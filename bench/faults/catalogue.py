"""All faults that are flown, in the table's order."""

from bench.faults.fault import Fault
from bench.faults.kinds import clocks, estimator, files, hostile, link, machine, pilot, processes, sensors, weather

_FAULTS: tuple[Fault, ...] = (
    *link.FAULTS,
    *sensors.FAULTS,
    *clocks.FAULTS,
    *processes.FAULTS,
    *machine.FAULTS,
    *estimator.FAULTS,
    *weather.FAULTS,
    *hostile.FAULTS,
    *pilot.FAULTS,
)
FLOWN = {fault.name: fault for fault in _FAULTS}
FILES = {fault.name: fault for fault in files.FAULTS}
assert len(FLOWN) == len(_FAULTS), "every fault has a name of its own"
