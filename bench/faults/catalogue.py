"""All faults, in the table's order."""

from bench.faults import clocks, estimator, hostile, link, pilot, processes, sensors, weather

GROUPS = {
    "link": link.FAULTS,
    "sensors": sensors.FAULTS,
    "clock": clocks.FAULTS,
    "process": processes.FAULTS,
    "estimator": estimator.FAULTS,
    "wind and body": weather.FAULTS,
    "hostile packets": hostile.FAULTS,
    "pilot": pilot.FAULTS,
}
FLOWN = {fault.name: fault for faults in GROUPS.values() for fault in faults}
assert len(FLOWN) == sum(map(len, GROUPS.values())), "every fault has a name of its own"
