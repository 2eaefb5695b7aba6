"""For test authors: a simulated PX4 in a test, with walls to place, faults to inject and the truth to read.

`start_vehicle` serves one on real sockets, `LockstepVehicle` is one in memory on virtual time. See
docs/how-to/testing.md.
"""

from sim_vehicle.bench import faults
from sim_vehicle.bench.bench import Handle, LockstepVehicle, Setup
from sim_vehicle.bench.faults import FaultRequest
from sim_vehicle.bench.truth import TimelineEntry as Event
from sim_vehicle.bench.truth import Truth
from sim_vehicle.obstacles import BoxSpec as Box
from sim_vehicle.obstacles import MotionSpec as Motion
from sim_vehicle.obstacles import PoleSpec as Pole
from sim_vehicle.obstacles import WallSpec as Wall
from sim_vehicle.shell.background import RunningVehicle, start_vehicle
from sim_vehicle.shell.truth_file import load_truth, save_truth
from sim_vehicle.truth import FaultSpan, Hit

__all__ = [
    "Box",
    "Event",
    "FaultRequest",
    "FaultSpan",
    "Handle",
    "Hit",
    "LockstepVehicle",
    "Motion",
    "Pole",
    "RunningVehicle",
    "Setup",
    "Truth",
    "Wall",
    "faults",
    "load_truth",
    "save_truth",
    "start_vehicle",
]
