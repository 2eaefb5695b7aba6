"""One row of numbers out of the kernels at the end of an interval: reading a record in Python is slow."""

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import Constants, PlantState
from sim_vehicle.quantities import Floats

# What really is: time (us), position, velocity, attitude, contact force, folds. `truth.py` keeps these.
_FOLDS, TRUTH = 12, slice(0, 12 + MOST_ROTORS)
# What the vehicle's own software may know: mean specific force, mean rates and clip counts; after them its estimate of
# position, velocity, attitude and acceleration, the share of all thrust that is commanded, and that of each motor.
_SENSED = 12 + MOST_ROTORS
_ESTIMATE, _ACCELERATION, _COMMANDS = _SENSED + 9, _SENSED + 19, _SENSED + 22
SENSED, KNOWN = slice(_SENSED, _ESTIMATE), slice(_SENSED, _COMMANDS + 1 + MOST_ROTORS)
# How many hits ended in the interval.
HITS_ENDED = _COMMANDS + 1 + MOST_ROTORS
REPORT_COLUMNS = HITS_ENDED + 1


@njit
def write_report(state: PlantState, constants: Constants, row: Floats) -> None:
    """Fill ``row`` (REPORT_COLUMNS,) from the state."""
    row[0] = state.time_us
    for i in range(10):
        row[1 + i] = state.body[i]
        row[_ESTIMATE + i] = state.estimate[i]
    row[_FOLDS - 1] = state.peak_force_n
    commanded = 0.0
    for i in range(constants.rotors):
        row[_FOLDS + i] = state.fold_m[i]
        row[_COMMANDS + 1 + i] = state.motor_command_n[i] / constants.motor_max_n
        commanded += row[_COMMANDS + 1 + i]
    row[_COMMANDS] = commanded / constants.rotors
    row[HITS_ENDED] = state.finished_count
    for i in range(3):
        row[_SENSED + i] = state.specific_force_sum[i] / constants.raw_per_interval
        row[_SENSED + 3 + i] = state.rate_sum[i] / constants.raw_per_interval
        row[_SENSED + 6 + i] = state.clip_counts[i]
        row[_ACCELERATION + i] = state.acceleration_ned_m_s2[i]


@njit
def report_estimate(
    body: Floats, estimate: Floats, acceleration: Floats, frame_offset_ned_m: Floats, row: Floats
) -> None:
    """Put another estimate of position, velocity, attitude and acceleration into ``row``, and into the offset how far
    it is from where the body is.
    """
    for i in range(3):
        frame_offset_ned_m[i] = estimate[i] - body[i]
        row[_ACCELERATION + i] = acceleration[i]
    for i in range(10):
        row[_ESTIMATE + i] = estimate[i]
