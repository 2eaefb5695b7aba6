"""What a healthy vehicle shakes, on each axis and in each phase of its flight: the floor under every threshold."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from companion.messages import ExtendedState, Heartbeat, LandedState, LocalPosition
from rebound_cli.logs.log import Log

Floats = npt.NDArray[np.float64]


class Stage(Enum):
    """A phase of a flight; the value is the word shown to people."""

    GROUND = "on the ground"
    TAKEOFF = "take-off"
    HOVER = "hover"
    UNDER_WAY = "under way"
    LANDING = "landing"


# Away from the ground, a take-off and a landing.
FLYING = (Stage.HOVER, Stage.UNDER_WAY)

# The running mean's. Long enough for 25 samples at 50 Hz (a spread good to 15 %), short enough to have forgotten the
# ground by the top of a take-off and to follow drag as the speed changes.
MEMORY_US = 500_000
# PX4's take-off ramp lasts MPC_TKO_RAMP_T, 3 s.
TAKEOFF_US = 3_000_000
# The land detector says "landed" a second or more after the touch; the slowest of four real landings took 2.4 s.
LANDING_US = 4_000_000
# Slower than this is hovering: an estimate's own noise and a pilot's corrections.
HOVER_M_S = 0.5
# PX4's limit of the accelerometer it was made for: +-16 g. A sample this near to it holds clipped readings.
CLIPPED_M_S2 = 150.0


@dataclass(frozen=True, slots=True)
class Shaking:
    """Departures of the specific force from its own running mean, (n, 3) body FRD, and what the vehicle was doing."""

    at_us: npt.NDArray[np.int64]
    departure_frd_m_s2: Floats
    stages: npt.NDArray[np.object_]
    interval_us: float

    def lasted_s(self, *stages: Stage) -> float:
        """How long it was in these."""
        return sum(stage in stages for stage in self.stages) * self.interval_us * 1e-6

    def during(self, stage: Stage) -> Floats:
        """Departures in this stage."""
        departures: Floats = self.departure_frd_m_s2[self.stages == stage]
        return departures

    def noise_m_s2(self) -> Mapping[Stage, Floats]:
        """RMS on each axis for every stage with more than a second of samples."""
        rows = {stage: self.during(stage) for stage in Stage}
        return {
            stage: np.sqrt((row**2).mean(axis=0)) for stage, row in rows.items() if len(row) * self.interval_us > 1e6
        }


def shaking(log: Log) -> Shaking:
    """Of all IMU samples of the log."""
    imu = log.imu()
    at_us = np.array([time_us for time_us, _ in imu], dtype=np.int64)
    force = np.array([sample.specific_force_frd_m_s2 for _, sample in imu])
    return Shaking(at_us, _departures(force, log.imu_interval_us), _stages(log, at_us), log.imu_interval_us)


def _departures(force: Floats, interval_us: float) -> Floats:
    """From the exponential mean of the samples before, as the detectors' noise floor has it."""
    share = min(1.0, interval_us / MEMORY_US)
    departures = np.empty_like(force)
    mean = force[0].copy()
    for index, row in enumerate(force):
        departures[index] = row - mean
        mean += share * departures[index]
    return departures


def _stages(log: Log, at_us: npt.NDArray[np.int64]) -> npt.NDArray[np.object_]:
    """By the land detector and the speed; without a land detector whatever is armed flies."""
    # When it was on the ground or not even armed, and when it was slow: one row a change.
    down, slow = [(int(at_us[0]), False)], [(int(at_us[0]), False)]
    landed = disarmed = False
    for heard in log.heard:
        match heard.sample:
            case ExtendedState():
                landed = heard.sample.landed_state is LandedState.ON_GROUND
            case Heartbeat():
                disarmed = not heard.sample.armed
            case LocalPosition():
                slow.append((heard.at_us, math.hypot(*heard.sample.velocity_ned_m_s) < HOVER_M_S))
        if down[-1][1] != (landed or disarmed):
            down.append((heard.at_us, landed or disarmed))
    stages = np.full(len(at_us), Stage.UNDER_WAY, dtype=object)

    def mark(start_us: int, end_us: int, stage: Stage) -> None:
        stages[slice(*np.searchsorted(at_us, (start_us, end_us)))] = stage

    end_us = int(at_us[-1]) + 1
    for start_us, next_us in _spans(slow, end_us):
        mark(start_us, next_us, Stage.HOVER)
    on_ground = _spans(down, end_us)
    for start_us, next_us in on_ground:
        mark(next_us, next_us + TAKEOFF_US, Stage.TAKEOFF)
        mark(start_us - LANDING_US, start_us, Stage.LANDING)
    for start_us, next_us in on_ground:
        mark(start_us, next_us, Stage.GROUND)
    return stages


def _spans(changes: list[tuple[int, bool]], end_us: int) -> list[tuple[int, int]]:
    """Beginning and end of each time in which it was so."""
    return [(start, end) for (start, was_so), (end, _) in pairwise([*changes, (end_us, False)]) if was_so]


def clipped(log: Log) -> tuple[int, str]:
    """IMU samples with clipped readings in them, and how that is known."""
    if log.clipped_at_us is not None:
        return len(log.clipped_at_us), "by the sensor's own flags"
    count = sum(max(map(abs, sample.specific_force_frd_m_s2)) >= CLIPPED_M_S2 for _, sample in log.imu())
    return count, f"samples of {CLIPPED_M_S2:g} m/s^2 or more"
