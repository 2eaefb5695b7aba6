"""Sensors and estimates that say what is not so."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.faults.injectors import Inject, adding, flying, rewriting, setting
from bench.fly.air import COMPLETED, HANDED_OVER, Air, Expected, Fault, Injector, When
from bench.fly.packets import ATTITUDE, IMU, ODOMETRY, POSITION, changed
from companion.mavlink.packet import message_id_of
from sim_vehicle.bench.faults import other

_BLIND = Expected((COMPLETED, HANDED_OVER), finds=False, has_wall=False)
_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)
_MAY_MISS = Expected(finds=False)
# Off, and known to be: a detector without forces sees no hit.
_OFF = Expected(finds=False, blinds=True)
# A sensor that steps and stays shows what a push does, and its own estimate is no second witness.
_STEPS = Expected(finds=False, false_hits=1)
_NAN = math.nan


def _noise(message: Any, air: Air) -> None:
    """An accelerometer that is off, with the noise of its converter."""
    for axis in ("xacc", "yacc", "zacc"):
        setattr(message, axis, air.chance.gauss(0.0, 0.02))


@dataclass
class Stuck(Injector):
    """Messages come at their rate, with the stamps of their time, and say for ever what they said at first."""

    when: When
    numbers: Sequence[int]
    first: dict[int, bytes] = field(default_factory=dict)

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [self._stuck(air, frame) if message_id_of(frame) in self.numbers else frame for frame in frames]

    def _stuck(self, air: Air, frame: bytes) -> bytes:
        first = self.first.setdefault(message_id_of(frame), frame)
        micro = air.vehicle.time_boot_us

        def restamp(message: Any) -> None:
            for name, unit_us in (("time_usec", 1), ("time_boot_ms", 1000)):
                if hasattr(message, name):
                    setattr(message, name, micro // unit_us)

        return changed(first, restamp)


@dataclass
class Thinned(Injector):
    """Of some messages only every n-th comes."""

    when: When
    numbers: Sequence[int]
    keep_every: int
    count: int = 0

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [frame for frame in frames if message_id_of(frame) not in self.numbers or self._is_kept()]

    def _is_kept(self) -> bool:
        self.count += 1
        return self.count % self.keep_every == 0


def _rewritten(number: int, for_s: float = math.inf, **fields: float) -> Inject:
    return rewriting((number,), setting(**fields), for_s)


def _repeating(message: Any, air: Air) -> None:
    message.time_usec -= message.time_usec % 100_000


def _backwards(message: Any, air: Air) -> None:
    message.time_usec -= air.chance.choice((0, 0, 0, 50_000, 200_000))


FAULTS = (
    Fault("gyro NaN", "HIGHRES_IMU with a NaN rate, from the cruise on", _rewritten(IMU, xgyro=_NAN), _BLIND),
    Fault("accelerometer NaN", "HIGHRES_IMU with a NaN force, from the cruise on", _rewritten(IMU, yacc=_NAN), _BLIND),
    Fault(
        "position NaN",
        "LOCAL_POSITION_NED and ODOMETRY without a number for 1 s",
        rewriting((POSITION, ODOMETRY), setting(x=_NAN, vx=_NAN), 1.0),
        _MAY_END,
    ),
    Fault("accelerometer 3e38", "one IMU axis at 3e38 m/s2 for 0.1 s", _rewritten(IMU, 0.1, xacc=3e38), _MAY_MISS),
    Fault(
        "accelerometer 2000 m/s2",
        "one axis beyond any sensor's range for 0.1 s",
        _rewritten(IMU, 0.1, xacc=2000.0),
        _MAY_MISS,
    ),
    Fault(
        "quaternion 1e20", "ATTITUDE_QUATERNION of length 1e20 for 1 s", _rewritten(ATTITUDE, 1.0, q1=1e20), _MAY_END
    ),
    Fault("accelerometer zero", "zero on all axes for 1 s", _rewritten(IMU, 1.0, xacc=0.0, yacc=0.0, zacc=0.0), _OFF),
    Fault(
        "accelerometer near zero",
        "zero with noise of 0.02 m/s2 on all axes for 1 s",
        rewriting((IMU,), _noise, 1.0),
        _OFF,
    ),
    Fault(
        "IMU stuck",
        "the same six values with new stamps, from the cruise on",
        lambda c: Stuck(When.flying(c), (IMU,)),
        _BLIND,
    ),
    Fault(
        "one axis stuck",
        "the accelerometer's x axis stays as it is, from the cruise on",
        flying(other("imu_stuck", axis="accelerometer_x")),
        _MAY_MISS,
    ),
    Fault(
        "accelerometer biased",
        "1 m/s2 on each axis from one sample to the next, from the cruise on; the step may count as a push",
        flying(other("imu_bias", accelerometer_frd_m_s2=(1.0, 1.0, 1.0))),
        _STEPS,
    ),
    Fault(
        "gyro biased",
        "0.5 rad/s on each axis of HIGHRES_IMU from one sample to the next, from the cruise on; the same",
        rewriting((IMU,), adding(xgyro=0.5, ygyro=0.5, zgyro=0.5)),
        _STEPS,
    ),
    Fault(
        "ODOMETRY frozen",
        "ODOMETRY and LOCAL_POSITION_NED stay where they are, with new stamps, for 2 s",
        lambda c: Stuck(When.flying(c, 2.0), (ODOMETRY, POSITION)),
        _BLIND,
    ),
    Fault(
        "wrong frame",
        "ODOMETRY in body frames, from the cruise on",
        rewriting((ODOMETRY,), setting(frame_id=12, child_frame_id=12)),
    ),
    Fault(
        "IMU slow",
        "inertial samples 100 ms late, from the cruise on",
        flying(other("wire", delay_s=0.1, messages=("HIGHRES_IMU",), direction="to_companion")),
    ),
    Fault(
        "IMU at 20 Hz",
        "one sample of twelve comes, from the cruise on",
        lambda c: Thinned(When.flying(c), (IMU,), 12),
        _BLIND,
    ),
    Fault("IMU gone", "no inertial sample from the cruise on", flying(other("imu_dropout")), _BLIND),
    Fault("stamps backwards", "two of five IMU stamps go back by 50 or 200 ms", rewriting((IMU,), _backwards), _BLIND),
    Fault(
        "stamps jump",
        "IMU stamps 10 s ahead of all others, from the cruise on",
        rewriting((IMU,), adding(time_usec=10_000_000)),
        _BLIND,
    ),
    Fault("stamps repeated", "25 IMU samples in a row have one stamp", rewriting((IMU,), _repeating), _BLIND),
)
