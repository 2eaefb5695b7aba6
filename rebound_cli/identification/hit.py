"""A hit on a wall, from a flight's log: the wall's push from the IMU, the speeds from the vehicle's estimate."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.errors import ReboundError
from companion.motion.strapdown import Strapdown
from rebound_cli.logs.log import Log
from rebound_cli.results.flight_log import FlightLog, flight_log_of_log
from rebound_cli.results.run_folder import TLOG_NAME

Floats = npt.NDArray[np.float64]

# A touch: above the lateral specific force of the detector's default, so that drag and vibration are none.
_TOUCH_M_S2 = 4.0
# Slower than this the vehicle is hovering or landing, and its estimate's error would be most of the speed.
_SLOWEST_HIT_M_S = 0.3
# The release: twice the usual noise and drag at the low speed after a hit.
_RELEASE_M_S2 = 1.0
# Quiet for this long ends a contact (the simulated vehicle's own rule for one hit).
_QUIET_S = 0.02
# The estimate before the touch is averaged over this: five samples at 50 Hz.
_BEFORE_S = 0.1
# After it the greatest speed away is taken within this: the estimate is late by 20 ms or more, and on a real
# vehicle smoothed over some tens; later the autopilot is already braking.
_AFTER_S = 0.15
# Clipping hides a part of a hit from the vehicle's estimate: a real PX4's was right after 1.2 s (bench/notes/px4.md).
# From this long after the release the velocity is carried back to it by what the accelerometer has summed up since.
_RIGHT_AGAIN_S = (1.3, 1.8)
# Standard deviation of a speed of a good optical-flow or motion-capture estimate.
_SPEED_SIGMA_M_S = 0.03
# Of one that was carried back: a bias of 0.05 m/s2 and an attitude off by 3 mrad over 1.5 s.
_CARRIED_SIGMA_M_S = 0.1
# Two numbers are fitted: with one sample more than that they are at least checked.
_FEWEST_SAMPLES = 3
# A sample this near to the usual +-16 g (156.9) has clipped raw samples in it and shows too little: no spring makes it.
_CLIPPED_M_S2 = 140.0
# A sample is the mean of raw ones: with a third of them clipped it shows this, whatever the others do.
_MAY_BE_CLIPPED_M_S2 = _CLIPPED_M_S2 / 3
# A push that rises again to this share over its first decay has met the stop of the arms.
_STOP_RISE = 1.3


class IdentificationError(ReboundError):
    """Data from which no contact can be identified: the sentence says what is missing."""


@dataclass(frozen=True, slots=True)
class Push:
    """The wall's push through a hit, as an inertial sensor shows it."""

    since_touch_s: Floats
    depth_m: Floats  # of the centre of mass beyond its place at the first touch
    speed_m_s: Floats  # towards the wall
    acceleration_m_s2: Floats  # away from the wall, without thrust and gravity


@dataclass(frozen=True, slots=True)
class Hit:
    """One hit. Speeds are of the centre of mass, across the wall's face."""

    name: str
    at_s: float  # of the data's own clock
    speed_in_m_s: float  # the greatest towards the wall before it
    speed_out_m_s: float  # the greatest away from the wall after it
    speed_sigma_m_s: float  # standard deviation of either speed
    guards: int  # that meet the wall: 2 head-on, 1 with the nose turned by 45 degrees
    push: Push | None = None
    stop_m: float | None = None  # depth at which the stop of the arms was met, if it was

    @property
    def ratio(self) -> float:
        return self.speed_out_m_s / self.speed_in_m_s

    @property
    def normal_change_m_s(self) -> float:
        return self.speed_in_m_s + self.speed_out_m_s


def guards_at(angle_rad: float) -> int:
    """2 where the nose, or a side, is within 22.5 degrees of the wall's normal; 1 at the diagonals."""
    off_rad = (angle_rad + math.pi / 4) % (math.pi / 2) - math.pi / 4
    return 2 if abs(off_rad) < math.pi / 8 else 1


def flight_hit(recorded: Log) -> Hit:
    """The hardest hit of a log. Raises IdentificationError."""
    log, path = flight_log_of_log(recorded), recorded.path
    if len(log.position_at_us) == 0:
        raise IdentificationError(f"{path}: no position in it; the speeds before and after a hit are needed.")
    name = path.parent.name if path.name == TLOG_NAME else path.stem
    lateral = np.hypot(log.specific_force_frd_m_s2[:, 0], log.specific_force_frd_m_s2[:, 1])
    touching = np.flatnonzero(lateral > _TOUCH_M_S2)
    # First and last sample of every contact.
    is_new = np.diff(1e-6 * log.imu_time_boot_us[touching]) >= _QUIET_S
    contacts = [part for part in np.split(touching, np.flatnonzero(is_new) + 1) if len(part)]
    hits = [hit for part in contacts if (hit := _hit(name, log, int(part[0]), int(part[-1]))) is not None]
    if not hits:
        raise IdentificationError(
            f"{path}: no hit found: no lateral specific force above {_TOUCH_M_S2:g} m/s2 "
            f"at a speed above {_SLOWEST_HIT_M_S:g} m/s that turned the vehicle around."
        )
    return max(hits, key=lambda hit: hit.normal_change_m_s)


def _hit(name: str, log: FlightLog, touch: int, release: int) -> Hit | None:
    force = log.specific_force_frd_m_s2[touch : release + 1]
    before = _between(log, log.imu_at_us[touch], -_BEFORE_S, 0.0)
    if not before.any():
        return None
    arriving = log.velocity_ned_m_s[before, :2].mean(axis=0)
    is_clipped = bool((np.abs(force) > _MAY_BE_CLIPPED_M_S2).any())
    leaving = _carried_back(log, release) if is_clipped else _soon_after(log, release, arriving)
    if leaving is None:
        return None
    away = (leaving - arriving) / np.linalg.norm(leaving - arriving)
    speed_in, speed_out = float(-arriving @ away), float(leaving @ away)
    if speed_in < _SLOWEST_HIT_M_S or speed_out <= 0:
        return None
    pushed = force[:, :2].sum(axis=0)
    push, stop_m = _push(log, touch, pushed / np.linalg.norm(pushed), speed_in)
    return Hit(
        name=name,
        at_s=1e-6 * float(log.imu_time_boot_us[touch]),
        speed_in_m_s=speed_in,
        speed_out_m_s=speed_out,
        speed_sigma_m_s=_CARRIED_SIGMA_M_S if is_clipped else _SPEED_SIGMA_M_S,
        guards=guards_at(float(np.arctan2(pushed[1], pushed[0]))),
        push=push,
        stop_m=stop_m,
    )


def _between(log: FlightLog, at_us: float, from_s: float, to_s: float) -> npt.NDArray[np.bool_]:
    """Which of the vehicle's velocities were heard so long after `at_us`."""
    since_s: Floats = 1e-6 * (log.position_at_us - at_us)
    return (since_s >= from_s) & (since_s < to_s)


def _soon_after(log: FlightLog, release: int, arriving_m_s: Floats) -> Floats | None:
    """The horizontal velocity furthest from that of the arrival, right after the release."""
    velocities: Floats = log.velocity_ned_m_s[_between(log, log.imu_at_us[release], 1e-6, _AFTER_S), :2]
    return max(velocities, key=lambda one: float(np.linalg.norm(one - arriving_m_s)), default=None)


def _carried_back(log: FlightLog, release: int) -> Floats | None:
    """The horizontal velocity at the release, from when the vehicle's estimate was right again."""
    later = _between(log, log.imu_at_us[release], *_RIGHT_AGAIN_S)
    if not later.any():
        return None
    summed = _summed_up(log)
    gained = [np.interp(log.position_at_us[later], log.imu_at_us, summed[:, axis]) for axis in range(2)]
    back: Floats = (log.velocity_ned_m_s[later, :2] - np.column_stack(gained)).mean(axis=0)
    # The first sample after the contact: the sum takes half of each sample's mean to be still to come.
    carried: Floats = back + summed[min(release + 1, len(summed) - 1)]
    return carried


def _summed_up(log: FlightLog) -> Floats:
    """What the accelerometer has summed up to by each of its samples, north and east, from any velocity."""
    strapdown, sums = Strapdown(), []
    told = zip(*(column.tolist() for column in (log.attitude_at_us, log.attitude_time_boot_us)), strict=True)
    attitudes = deque(zip(told, map(tuple, log.attitude_wxyz.tolist()), strict=True))
    vectors = (map(tuple, rows.tolist()) for rows in (log.specific_force_frd_m_s2, log.angular_velocity_frd_rad_s))
    for at_us, boot_us, force, rates in zip(log.imu_at_us, log.imu_time_boot_us, *vectors, strict=True):
        while attitudes and attitudes[0][0][0] <= at_us:
            (_, turned_boot_us), turn = attitudes.popleft()
            strapdown.attitude(turned_boot_us, turn)
        strapdown.imu(boot_us, force, rates)
        sums.append(strapdown.sum_ned_m_s[:2])
    return np.array(sums)


def _push(log: FlightLog, touch: int, direction: Floats, speed_m_s: float) -> tuple[Push | None, float | None]:
    """Depth, speed and push at the middle of every whole sample, and where the arms met their stop.

    Integrated from the speed at the touch. A sample is the mean over the interval that ends at its time. In the
    first, the touch lies somewhere: where, its size against the next one's tells.
    """
    push = log.specific_force_frd_m_s2[touch:, :2] @ direction
    interval_s = 1e-6 * float(np.median(np.diff(log.imu_time_boot_us)))
    released = np.flatnonzero(push[1:] < _RELEASE_M_S2)
    push = push[: 1 + int(released[0])] if len(released) else push
    if len(push) <= _FEWEST_SAMPLES:
        return None, None
    pressed_s = interval_s * min(1.0, float(push[0] / push[1]))
    speed = (speed_m_s - interval_s * np.cumsum(push))[:-1]  # at the beginning of each whole sample
    push = push[1:]
    middle = speed - push * interval_s / 2
    begin_m = speed_m_s * pressed_s + interval_s * (np.cumsum(middle) - middle)
    depth = begin_m + (speed + middle) * interval_s / 4
    since_s: Floats = pressed_s + interval_s * (np.arange(len(push), dtype=np.float64) + 0.5)
    # The push rises again after it has begun to decay, or clips.
    stopped = np.flatnonzero((push > _STOP_RISE * np.minimum.accumulate(push) + _RELEASE_M_S2) | (push > _CLIPPED_M_S2))
    whole = int(stopped[0]) - 1 if len(stopped) else len(push)
    if whole < _FEWEST_SAMPLES:
        return None, None
    stop_m = float(depth[whole]) if len(stopped) else None
    return Push(since_s[:whole], depth[:whole], middle[:whole], push[:whole]), stop_m
