"""The columns and charts of a flight: for its page, live or afterwards. Each as fine as it is kept.

Finer than any of the sensors, so that two bytes hold most numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from companion.reflex.config import LONGEST_SLOW_STEP_US
from rebound_cli.results.flight_log import FlightLog

Floats = npt.NDArray[np.float64]
# Values and their resolution, by the column's name.
Columns: TypeAlias = dict[str, tuple[Floats, float]]

TIME_S, PLACE_M, SPEED_M_S, UNIT, FORCE_M_S2, RATE_RAD_S, FOLD_M = 1e-5, 1e-3, 1e-3, 1e-4, 1e-2, 1e-3, 1e-4
ANGLE_DEG, RATIO = 1e-2, 1e-2
NED, VELOCITY, TURN = ("n", "e", "d"), ("vn", "ve", "vd"), ("qw", "qx", "qy", "qz")


@dataclass(frozen=True, slots=True)
class Line:
    """A column of a table. Of another table than the first line's: its last row, if no older than `held_s`."""

    table: str
    column: str
    label: str
    colour: str
    dashed: bool = False
    held_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Overview:
    """A chart of the whole flight. What passes `top` leaves the picture; `level` is a line across it."""

    title: str
    unit: str
    lines: Sequence[Line]
    top: float | None = None
    level: tuple[float, str] | None = None


# Setpoints come twice a second at least while somebody sends any; those by attitude with each IMU sample.
_PLACE_HELD_S, _ATTITUDE_HELD_S = 1.0, 0.3
# Velocities further apart than this are not compared.
_JUMP_HELD_S = 1e-6 * LONGEST_SLOW_STEP_US
OVERVIEWS = (
    Overview(
        "Speed and height",
        "m/s, m",
        (Line("path", "speed", "speed, m/s", "blue"), Line("path", "height", "height, m", "orange", dashed=True)),
    ),
    Overview(
        "Place and setpoint",
        "m",
        (
            Line("path", "n", "north", "blue"),
            Line("setpoint", "n", "its setpoint", "blue", dashed=True, held_s=_PLACE_HELD_S),
            Line("path", "e", "east", "orange"),
            Line("setpoint", "e", "its setpoint", "orange", dashed=True, held_s=_PLACE_HELD_S),
        ),
    ),
    Overview(
        "Lean",
        "°",
        (
            Line("attitude", "roll", "roll, right side down", "blue"),
            Line("attitude", "pitch", "pitch, nose up", "orange", dashed=True),
        ),
    ),
    Overview(
        "Tilt, wanted and flown; green: hand-over",
        "°",
        (
            Line("attitude", "tilt", "flown", "blue"),
            Line("wanted", "tilt", "wanted by the companion", "red", held_s=_ATTITUDE_HELD_S),
            Line("target", "tilt", "wanted by the vehicle's own control", "orange", True, _ATTITUDE_HELD_S),
        ),
    ),
    Overview(
        "Thrust, wanted and flown; green: hand-over",
        "share of the most",
        (
            Line("target", "thrust", "flown by the vehicle's own control", "blue"),
            Line("wanted", "thrust", "wanted by the companion", "red", held_s=_ATTITUDE_HELD_S),
        ),
    ),
    # What a contact makes leaves the picture: what came near to one is looked for.
    Overview(
        "How near to a hit, while the detector was on",
        "thresholds",
        (
            Line("imu", "ratio", "push over threshold", "blue"),
            Line("jump", "ratio", "velocity jump over threshold", "orange", held_s=_JUMP_HELD_S),
        ),
        top=1.5,
        level=(1.0, "a hit from here on"),
    ),
    Overview("Specific force sideways", "m/s²", (Line("force", "peak", "largest in a tenth of a second", "blue"),)),
)


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
