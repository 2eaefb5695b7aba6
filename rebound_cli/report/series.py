"""The columns of a flight: for its page, live or afterwards. Each as fine as it is kept.

Finer than any of the sensors, so that two bytes hold most numbers.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from rebound_cli.results.flight_log import FlightLog, Floats
from rebound_cli.results.truth_match import FlightTruth

# Values and their resolution, by the column's name.
Columns: TypeAlias = dict[str, tuple[Floats, float]]

TIME_S, PLACE_M, SPEED_M_S, UNIT, FORCE_M_S2, RATE_RAD_S, FOLD_M = 1e-5, 1e-3, 1e-3, 1e-4, 1e-2, 1e-3, 1e-4
ANGLE_DEG, RATIO = 1e-2, 1e-2
NED, VELOCITY, TURN = ("n", "e", "d"), ("vn", "ve", "vd"), ("qw", "qx", "qy", "qz")
# Every one of them says where the vehicle was.
PLACES = (*NED, "height")


def times(at_us: Floats, since_us: float) -> Columns:
    return {"t": ((at_us - since_us) * 1e-6, TIME_S)}


def vector(names: Sequence[str], rows: Floats, resolution: float) -> Columns:
    return {name: (rows[:, number], resolution) for number, name in enumerate(names)}


def _tilt(attitude_wxyz: Floats) -> Columns:
    """How far the thrust leans from upright."""
    _, x, y, _ = attitude_wxyz.T
    return {"tilt": (np.degrees(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))), ANGLE_DEG)}


def _lean(attitude_wxyz: Floats) -> Columns:
    w, x, y, z = attitude_wxyz.T
    roll_rad = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch_rad = np.arcsin(np.clip(2.0 * (w * y - x * z), -1.0, 1.0))
    return vector(("roll", "pitch"), np.degrees(np.column_stack([roll_rad, pitch_rad])), ANGLE_DEG)


def _attitude_control(at_us: Floats, asked: Floats, started_us: float) -> Columns:
    return times(at_us, started_us) | _tilt(asked[:, :4]) | {"thrust": (asked[:, 4], UNIT)}


def series(log: FlightLog, started_us: float) -> dict[str, Columns]:
    """Of each stream that every flight has; `t` is seconds since the flight began."""
    return {
        "imu": times(log.imu_at_us, started_us)
        | vector(("fx", "fy", "fz"), log.specific_force_frd_m_s2, FORCE_M_S2)
        | vector(("p", "q", "r"), log.angular_velocity_frd_rad_s, RATE_RAD_S),
        "path": times(log.position_at_us, started_us)
        | vector(NED, log.position_ned_m, PLACE_M)
        | vector(VELOCITY, log.velocity_ned_m_s, SPEED_M_S)
        | {"speed": (np.linalg.norm(log.velocity_ned_m_s, axis=1), SPEED_M_S)}
        | {"height": (-log.position_ned_m[:, 2], PLACE_M)},
        "attitude": times(log.attitude_at_us, started_us)
        | vector(TURN, log.attitude_wxyz, UNIT)
        | _lean(log.attitude_wxyz)
        | _tilt(log.attitude_wxyz),
        "target": _attitude_control(log.target_at_us, log.target, started_us),
        "wanted": _attitude_control(log.wanted_at_us, log.wanted, started_us),
        "setpoint": times(log.setpoint_at_us, started_us) | vector(NED, log.setpoint_ned_m, PLACE_M),
    }


def of_truth(truth: FlightTruth, started_us: float) -> Columns:
    """The same of what the simulator knows."""
    true, folds_m = truth.series, truth.series["arm_fold_m"]
    return (
        times(truth.at_us(true["time_boot_us"]), started_us)
        | vector(NED, true["position_ned_m"], PLACE_M)
        | vector(VELOCITY, true["velocity_ned_m_s"], SPEED_M_S)
        | vector(TURN, true["attitude_wxyz"], UNIT)
        | vector([f"fold{arm}" for arm in range(1, 1 + folds_m.shape[1])], folds_m, FOLD_M)
    )
