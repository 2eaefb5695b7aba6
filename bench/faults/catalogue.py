"""All faults, in the table's order."""

from bench.faults import clocks, estimator, files, hostile, link, machine, pilot, processes, sensors, weather

GROUPS = {
    "link": link.FAULTS,
    "sensors": sensors.FAULTS,
    "clock": clocks.FAULTS,
    "process": processes.FAULTS,
    "disk and console": machine.FAULTS,
    "estimator": estimator.FAULTS,
    "wind and body": weather.FAULTS,
    "hostile packets": hostile.FAULTS,
    "pilot": pilot.FAULTS,
}
FLOWN = {fault.name: fault for faults in GROUPS.values() for fault in faults}
FILES = {fault.name: fault for fault in files.FAULTS}
assert len(FLOWN) == sum(map(len, GROUPS.values())), "every fault has a name of its own"
