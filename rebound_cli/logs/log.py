"""What every reader gives: typed samples in the order heard, and what the log cannot tell."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from companion import messages
from companion.autopilot.px4.firmware import PX4
from companion.errors import ReboundError
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID, Identity, identify
from companion.messages import Heartbeat, ImuSample, MessageId, PositionTarget, Sample, Vector3

# Without these a detector loses something.
WANTED = {
    MessageId.LOCAL_POSITION_NED: messages.LocalPosition,
    MessageId.ATTITUDE_QUATERNION: messages.Attitude,
    MessageId.EXTENDED_SYS_STATE: messages.ExtendedState,
    MessageId.ATTITUDE_TARGET: messages.AttitudeTarget,
    MessageId.ODOMETRY: messages.Odometry,
}
# MAV_STATE, as PX4 fills HEARTBEAT.system_status; MAV_TYPE where a log names none.
_STANDBY, _ACTIVE, _CRITICAL = 3, 4, 5
QUADROTOR = 2
# No battery lasts so long: a time stamp further from the middle of the log is damage.
LONGEST_US = 24 * 3600 * 1_000_000
# Slower than a third of the wire's 30 Hz, a velocity is old by the time of a hit.
_SLOW_HZ = 15.0
# PX4's limit of the accelerometer it was made for: +-16 g. A sample this near to it holds clipped readings.
_CLIPPED_M_S2 = 150.0


class LogError(ReboundError):
    """The log cannot be read or holds nothing that a detector could use."""


class LoggedSample(NamedTuple):
    """A sample and when it was heard, in microseconds of the log's own clock."""

    at_us: int
    sample: Sample


@dataclass(frozen=True, slots=True)
class Log:
    """A recorded flight. `losses` are sentences: what is missing, and what that costs.

    `clipped_at_us`: IMU samples known to hold clipped readings; None where nothing tells.
    `averaging_us`: the interval over which all but the longest hundredth of the samples are means, where it is told.
    `is_filtered`: samples are not means but points behind a low-pass filter of second order.
    `low_pass_hz`: its cut-off, where it is known.
    """

    path: Path
    vehicle: str
    started_at_us: int
    heard: tuple[LoggedSample, ...]
    losses: tuple[str, ...]
    clipped_at_us: tuple[int, ...] | None = None
    averaging_us: float | None = None
    is_filtered: bool = False
    low_pass_hz: float | None = None

    @property
    def window_us(self) -> float | None:
        """How long before its stamp a contact may have been that a sample still holds.

        Of a low-pass filter it is the first lobe of its answer, which is 4 % below zero at most after that.
        """
        return self.averaging_us if self.low_pass_hz is None else 1e6 / (math.sqrt(2.0) * self.low_pass_hz)

    def imu(self) -> list[tuple[int, ImuSample]]:
        """All IMU samples with the time each was heard at."""
        return [(at_us, sample) for at_us, sample in self.heard if isinstance(sample, ImuSample)]

    @property
    def imu_rate_hz(self) -> float:
        """IMU samples a second, by the vehicle's clock; gaps count for nothing."""
        intervals_us = np.diff([sample.time_boot_us for _, sample in self.imu()])
        intervals_us = intervals_us[intervals_us > 0]
        return 1e6 / float(np.median(intervals_us)) if len(intervals_us) else 1.0

    @property
    def duration_s(self) -> float:
        return self.seconds(self.heard[-1].at_us) - self.seconds(self.heard[0].at_us)

    def seconds(self, at_us: float) -> float:
        """Since the log's start."""
        return (at_us - self.started_at_us) * 1e-6


def vector(row: Sequence[float]) -> Vector3:
    """The first three."""
    return row[0], row[1], row[2]


def position_target(position_ned_m: Sequence[float], velocity_down_m_s: float) -> PositionTarget:
    """What the vehicle's position control was asked for; NaN where nothing was."""
    position = vector(position_ned_m) if all(map(math.isfinite, position_ned_m)) else None
    return PositionTarget(position, velocity_down_m_s if math.isfinite(velocity_down_m_s) else None)


def in_order(heard: Iterable[LoggedSample], middle_us: float) -> tuple[LoggedSample, ...]:
    """By time, without stamps that are damage; `middle_us` is that of the log."""
    return tuple(sorted((h for h in heard if abs(h.at_us - middle_us) < LONGEST_US), key=lambda h: h.at_us))


def heartbeat(vehicle_type: int, armed: bool, custom_mode: int = 0, is_failing: bool = False) -> Heartbeat:
    """As a PX4 of that MAV_TYPE would send it."""
    status = _CRITICAL if is_failing else _ACTIVE if armed else _STANDBY
    return Heartbeat(1, AUTOPILOT_COMPONENT_ID, vehicle_type, PX4.mav_autopilot, armed, custom_mode, status)


def multicopter(path: Path, vehicle_type: int) -> Identity:
    """Of a log by its MAV_TYPE. Raises LogError for any other vehicle."""
    identity = identify(heartbeat(vehicle_type, False))
    if isinstance(identity, str):
        raise LogError(f"{path}: {identity}; collisions are looked for in multicopters' logs alone.")
    return identity


def slow_velocity(name: str, rate_hz: float) -> Iterator[str]:
    """What is lost where a log holds fewer velocities than the wire carries."""
    if rate_hz < _SLOW_HZ:
        yield f"{name} is logged at {rate_hz:.0f} Hz, not 30: v_c is coarser, and no hit between two IMU samples shows"


def clipping_text(log: Log) -> str:
    """How many IMU samples have clipped readings in them, and how that is known."""
    if log.clipped_at_us is not None:
        count, how = len(log.clipped_at_us), "by the sensor's own flags"
    else:
        count = sum(max(map(abs, sample.specific_force_frd_m_s2)) >= _CLIPPED_M_S2 for _, sample in log.imu())
        how = f"samples of {_CLIPPED_M_S2:g} m/s^2 or more"
    return f"clipping: {count or 'no'} sample{'' if count == 1 else 's'} ({how})"
