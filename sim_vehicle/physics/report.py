"""One row of numbers out of the kernels at the end of an interval: reading a record in Python is slow."""

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import Constants, PlantState
from sim_vehicle.physics.record import Floats

# What really is: time (us), position, velocity, attitude, folds, contact force. `truth.py` keeps these.
TRUTH = slice(0, 16)
# What the vehicle's own software may know: mean specific force, mean rates and clip counts; after them its estimate of
# position, velocity, attitude and acceleration, and the motors' commands.
SENSED, KNOWN = slice(16, 25), slice(16, 42)
# How many hits ended in the interval.
HITS_ENDED = 42
REPORT_COLUMNS = 43


@njit
def write_report(state: PlantState, constants: Constants, row: Floats) -> None:
    """Fill ``row`` (REPORT_COLUMNS,) from the state."""
    row[0] = state.time_us
    for i in range(10):
        row[1 + i] = state.body[i]
        row[25 + i] = state.estimate[i]
    for i in range(4):
        row[11 + i] = state.fold_m[i]
        row[38 + i] = state.motor_command_n[i] / constants.motor_max_n
    row[15] = state.peak_force_n
    row[HITS_ENDED] = state.finished_count
    for i in range(3):
        row[16 + i] = state.specific_force_sum[i] / constants.raw_per_interval
        row[19 + i] = state.rate_sum[i] / constants.raw_per_interval
        row[22 + i] = state.clip_counts[i]
        row[35 + i] = state.acceleration_ned_m_s2[i]


@njit
def report_estimate(
    body: Floats, estimate: Floats, acceleration: Floats, frame_offset_ned_m: Floats, row: Floats
) -> None:
    """Put another estimate of position, velocity, attitude and acceleration into ``row``, and into the offset how far
    it is from where the body is.
    """
    for i in range(3):
        frame_offset_ned_m[i] = estimate[i] - body[i]
        row[35 + i] = acceleration[i]
    for i in range(10):
        row[25 + i] = estimate[i]
