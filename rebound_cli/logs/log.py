"""What every reader gives: typed samples in the order heard, and what the log cannot tell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeAlias

from companion import messages
from companion.errors import ReboundError
from companion.messages import ImuSample, MessageId, Sample, Vector3

# Without these a detector loses something.
WANTED = {
    MessageId.LOCAL_POSITION_NED: messages.LocalPosition,
    MessageId.ATTITUDE_QUATERNION: messages.Attitude,
    MessageId.EXTENDED_SYS_STATE: messages.ExtendedState,
    MessageId.ATTITUDE_TARGET: messages.AttitudeTarget,
    MessageId.ODOMETRY: messages.Odometry,
    MessageId.VIBRATION: messages.Vibration,
}


class LogError(ReboundError):
    """The log cannot be read or holds nothing that a detector could use."""


@dataclass(frozen=True, slots=True)
class Demand:
    """What the vehicle's position control was asked for; local NED, None where nothing was (wholly) asked.

    The companion is told this by no message: in flight it knows what it sent. A log tells it of any pilot.
    """

    time_boot_us: int
    position_ned_m: Vector3 | None
    velocity_ned_m_s: Vector3 | None
    velocity_down_m_s: float | None

    @classmethod
    def of(cls, time_boot_us: int, position_ned_m: Sequence[float], velocity_ned_m_s: Sequence[float]) -> Self:
        """NaN where nothing was asked."""
        position = vector(position_ned_m) if all(map(math.isfinite, position_ned_m)) else None
        velocity = vector(velocity_ned_m_s) if all(map(math.isfinite, velocity_ned_m_s)) else None
        down = velocity_ned_m_s[2] if math.isfinite(velocity_ned_m_s[2]) else None
        return cls(time_boot_us, position, velocity, down)


Told: TypeAlias = Sample | Demand


@dataclass(frozen=True, slots=True)
class LoggedSample:
    """A sample and when it was heard, in microseconds of the log's own clock."""

    at_us: int
    sample: Told


@dataclass(frozen=True, slots=True)
class Log:
    """A recorded flight. `losses` are sentences: what is missing, and what that costs.

    `clipped_at_us`: IMU samples known to hold clipped readings; None where nothing tells.
    `averaging_us`: the interval over which all but the longest hundredth of the samples are means, where it is told.
    """

    path: Path
    vehicle: str
    started_at_us: int
    heard: tuple[LoggedSample, ...]
    losses: tuple[str, ...]
    clipped_at_us: tuple[int, ...] | None = None
    averaging_us: float | None = None

    def imu(self) -> list[tuple[int, ImuSample]]:
        """All IMU samples with the time each was heard at."""
        return [(heard.at_us, heard.sample) for heard in self.heard if isinstance(heard.sample, ImuSample)]

    @property
    def duration_s(self) -> float:
        return self.seconds(self.heard[-1].at_us) - self.seconds(self.heard[0].at_us)

    def seconds(self, at_us: float) -> float:
        """Since the log's start."""
        return (at_us - self.started_at_us) * 1e-6


def vector(row: Sequence[float]) -> Vector3:
    """The first three."""
    return row[0], row[1], row[2]
