"""Recorded flights, as they are and with recorded impacts put into them.

A semi-synthetic hit is a real flight of one vehicle and a real impact of another: neither knew of the other. The
impact is the drop's accelerometer at 1 kHz, turned so that its impulse points to where the hit is to come from, added
to what the flight's own sensor showed, clipped sample by sample and axis by axis at 16 g, and averaged over the
flight's own integration intervals, as PX4 does it. The flight's velocity estimate takes what its sensor showed of the
impact, because PX4's estimator integrates it. Nothing else of the flight knows of the hit.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.detectors.watching import configuration
from companion.errors import ReboundError
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Vector3
from companion.mission.config import CompanionConfig
from companion.motion.rotation import body_to_ned
from rebound_cli.logs.log import Log, LoggedSample, Told
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.watching import Circumstances, watch_log

Floats = npt.NDArray[np.float64]

LOGS_FOLDER, DROPS_FILE = "px4_logs", Path("drops") / "drops_mps2.npz"
# The one log with a collision in it, and none of the others has one. A hop ends on the ground: from 2.36 s after the
# log's start on it touches, 2.44 to 2.47 s is the strike itself, with 108 m/s^2; by 2.6 s it is over.
STRIKE_LOG, STRIKE_S = "ground_strike.ulg", (2.35, 2.60)

RANGE_M_S2 = 156.9  # +-16 g
DROP_STEP_S = 1e-3
# An impact begins where its force leaves free fall for good, and its frame has rung out after this.
FREE_FALL_M_S2 = 2.0 * 9.81
KEPT_BEFORE_S, KEPT_AFTER_S = 0.002, 0.060
# Away from take-off and from descents to the ground; after the hit there is still time to notice.
AIRBORNE_MARGIN_S = 2.0
SLICE_BEFORE_S, SLICE_AFTER_S = 5.0, 0.6
LONGEST_INTERVAL_US = 20_000
FOUND_WITHIN_S = 0.4
# Hits come from the side, up to this much from above or below.
ELEVATION_MAX_DEG = 20.0

# HIGHRES_IMU asked for; None: all that was recorded, 200 Hz and a little more.
RECORDED_RATES = {"200": None, "100": 100.0, "50": 50.0}
SCALES = (0.5, 1.0, 2.0)


class DataError(ReboundError):
    """The folder of recorded data does not hold what the bench looks for."""


@dataclass(frozen=True, slots=True)
class HealthyCase:
    """A recorded flight, every inertial magnitude times `scale`."""

    folder: str
    log: str
    scale: float
    detectors: tuple[str, ...]
    seed: int = 0


@dataclass(frozen=True, slots=True)
class InjectedCase:
    """A recorded impact in a recorded flight, at a moment and from a side drawn from the seed."""

    folder: str
    log: str
    drop: str
    seed: int
    detectors: tuple[str, ...]


def data_files(folder: Path) -> tuple[list[str], list[str]]:
    """Names of the logs and of the drops. Raises DataError."""
    logs = sorted(path.name for path in (folder / LOGS_FOLDER).glob("*.ulg"))
    if not logs or not (folder / DROPS_FILE).exists():
        raise DataError(
            f"{folder}: no {LOGS_FOLDER}/*.ulg or no {DROPS_FILE} in it; point --data at the folder that has both, "
            "or leave it away to do without recorded flights"
        )
    return logs, sorted(_drops(folder / DROPS_FILE))


# --- as they are --------------------------------------------------------------------------------------------------


def work_out_healthy(case: HealthyCase) -> dict[str, Any]:
    """Collisions and touches that each detector reports, in seconds after the log's start."""
    log = _read(Path(case.folder) / LOGS_FOLDER / case.log)
    if case.scale != 1.0:
        log = replace(log, heard=tuple(_scaled(log, case.scale)))
    result: dict[str, Any] = {"seconds": log.duration_s, "rates": {}}
    for rate, asked_hz in RECORDED_RATES.items():
        detectors = {}
        for name in case.detectors:
            findings = watch_log(log, configuration(name), asked_hz)
            detectors[name] = {
                "collisions": [[log.seconds(f.at_us), f.final.impact.kind.value] for f in findings.collisions],
                "touches": [[log.seconds(f.at_us), f.final.impact.kind.value] for f in findings.contacts],
                "blind_s": sum(span.duration_s for span in findings.blind),
            }
        result["rates"][rate] = detectors
    return result


def _scaled(log: Log, scale: float) -> Iterator[LoggedSample]:
    for item in log.heard:
        sample = item.sample
        if isinstance(sample, ImuSample):
            force, rate = (
                tuple(scale * value for value in vector)
                for vector in (sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s)
            )
            yield LoggedSample(item.at_us, ImuSample(sample.time_boot_us, _triple(force), _triple(rate)))
        else:
            yield item


# --- with an impact in them -----------------------------------------------------------------------------------------


def work_out_injected(case: InjectedCase) -> dict[str, Any]:
    """Whether and when each detector reports it, at each rate; what it reported before."""
    rng = np.random.default_rng([case.seed, 3])
    folder = Path(case.folder)
    log = _read(folder / LOGS_FOLDER / case.log)
    force, elevation = _drops(folder / DROPS_FILE)[case.drop], math.radians(ELEVATION_MAX_DEG)
    side, up = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(-elevation, elevation))
    towards = (math.cos(up) * math.cos(side), math.cos(up) * math.sin(side), math.sin(up))
    force = turned(force, towards, float(rng.uniform(-math.pi, math.pi)))
    moments = _moments(folder / LOGS_FOLDER / case.log)
    hit_us = moments[int(rng.integers(len(moments)))] + int(rng.integers(LONGEST_INTERVAL_US))
    # When the link sends its first sample has nothing to do with when the hit comes.
    begun_us = hit_us - round(1e6 * SLICE_BEFORE_S) - int(rng.integers(LONGEST_INTERVAL_US))
    struck = with_impact(log, force, begun_us, hit_us)
    result: dict[str, Any] = {"rates": {}, "impulse_m_s": float(np.linalg.norm(force.sum(axis=0)) * DROP_STEP_S)}
    for rate, asked_hz in RECORDED_RATES.items():
        detectors: dict[str, Any] = {}
        for name in case.detectors:
            collisions = watch_log(struck, configuration(name), asked_hz).collisions
            times = [f.at_us for f in collisions]
            late = [time - hit_us for time in times if 0 <= time - hit_us <= FOUND_WITHIN_S * 1e6]
            detectors[name] = {"false": sum(time < hit_us for time in times)}
            if late:
                detectors[name]["latency_ms"] = 1e-3 * late[0]
        result["rates"][rate] = detectors
    return result


def with_impact(log: Log, force_frd_m_s2: Floats, first_us: int, hit_us: int) -> Log:
    """The log from `first_us` until a little after `hit_us`, when the force (n, 3), 1 kHz, begins."""
    last_us = hit_us + round(SLICE_AFTER_S * 1e6)
    inside = [
        item
        for item in log.heard
        # Of what came before, all but the inertial samples: where the vehicle took off, what state it is in.
        if item.at_us <= last_us and (item.at_us >= first_us or not isinstance(item.sample, ImuSample))
    ]
    return replace(log, heard=tuple(_struck(inside, force_frd_m_s2, hit_us)))


def _struck(items: list[LoggedSample], force: Floats, hit_us: int) -> Iterator[LoggedSample]:
    attitude = (1.0, 0.0, 0.0, 0.0)
    last_imu_us = 0
    velocity = shift = np.zeros(3)
    shifted_us = hit_us
    for item in items:
        sample: Told = item.sample
        if isinstance(sample, Attitude):
            attitude = sample.attitude_wxyz
        elif isinstance(sample, ImuSample):
            window_us = min(sample.time_boot_us - last_imu_us, 10_000)
            last_imu_us = sample.time_boot_us
            own = np.array(sample.specific_force_frd_m_s2)
            seen = averaged(own, force, 1e-6 * (sample.time_boot_us - hit_us), 1e-6 * window_us)
            velocity = velocity + np.array(body_to_ned(attitude, _triple(seen - own))) * 1e-6 * window_us
            sample = replace(sample, specific_force_frd_m_s2=_triple(seen))
        elif isinstance(sample, LocalPosition | Odometry):
            shift = shift + velocity * 1e-6 * max(item.at_us - shifted_us, 0)
            shifted_us = max(item.at_us, hit_us)
            sample = replace(
                sample,
                position_ned_m=_triple(np.array(sample.position_ned_m) + shift),
                velocity_ned_m_s=_triple(np.array(sample.velocity_ned_m_s) + velocity),
            )
        yield LoggedSample(item.at_us, sample)


def averaged(own_m_s2: Floats, force_m_s2: Floats, end_s: float, window_s: float) -> Floats:
    """A sample of PX4's: mean over the window that ends `end_s` after the impact's first row, each axis clipped."""
    count = max(round(window_s / DROP_STEP_S), 1)
    middles_s = end_s - window_s + (np.arange(count) + 0.5) * window_s / count
    index = np.floor(middles_s / DROP_STEP_S).astype(int)
    inside = (index >= 0) & (index < len(force_m_s2))
    raw = np.tile(own_m_s2, (count, 1))
    raw[inside] += force_m_s2[index[inside]]
    if not inside.any():
        return own_m_s2
    mean: Floats = np.clip(raw, -RANGE_M_S2, RANGE_M_S2).mean(axis=0)
    return mean


def turned(force: Floats, towards: Vector3, roll_rad: float) -> Floats:
    """The same force, its impulse along `towards`; which of the ways to do so is chosen by `roll_rad`."""
    impulse = force.sum(axis=0)
    from_axes = _axes(impulse / np.linalg.norm(impulse), 0.0)
    result: Floats = force @ from_axes @ _axes(np.array(towards), roll_rad).T
    return result


def _axes(first: Floats, roll_rad: float) -> Floats:
    """Columns: `first`, and two square to it turned by the roll."""
    helper = np.eye(3)[int(np.argmin(np.abs(first)))]
    second = np.cross(first, helper)
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    cosine, sine = math.cos(roll_rad), math.sin(roll_rad)
    return np.column_stack([first, cosine * second + sine * third, -sine * second + cosine * third])


@lru_cache(maxsize=8)
def _moments(path: Path) -> list[int]:
    """Times at which the vehicle was up and not on its way to the ground, away from take-off and landing."""
    log, known = _read(path), Circumstances(CompanionConfig())
    free: list[tuple[int, bool]] = []
    before = known.situation
    for item in log.heard:
        known.hear((item.sample,), item.at_us)
        now = known.situation
        if now != before:
            before = now
            flies = now.landed_state is not LandedState.ON_GROUND and now.armed is not False
            free.append((item.at_us, flies and not now.descent_commanded))
    return [at_us for at_us in _steadily(free) if at_us - log.heard[0].at_us > 1e6 * SLICE_BEFORE_S]


def _steadily(free: list[tuple[int, bool]]) -> Iterator[int]:
    """Times that are free and have been for a margin, and will be."""
    margin = round(AIRBORNE_MARGIN_S * 1e6)
    taken = [at_us for at_us, is_free in free if not is_free] + [free[-1][0]]
    for at_us, is_free in free:
        index = bisect_left(taken, at_us)
        before = taken[index - 1] if index else free[0][0]
        if is_free and at_us - before >= margin and taken[index] - at_us >= margin:
            yield at_us


@lru_cache(maxsize=8)
def _read(path: Path) -> Log:
    return read_log(path)


@lru_cache(maxsize=1)
def _drops(path: Path) -> dict[str, Floats]:
    """Force of each impact, at 1 kHz, from just before its onset until it has rung out."""
    with np.load(path) as data:
        return {name: _impact(np.asarray(data[name], np.float64)) for name in data.files}


def _impact(rows: Floats) -> Floats:
    """Columns t_s, ax, ay, az at about 1 kHz, free fall before the impact."""
    time_s = np.arange(rows[0, 0], rows[-1, 0], DROP_STEP_S)
    force = np.column_stack([np.interp(time_s, rows[:, 0], rows[:, axis]) for axis in (1, 2, 3)])
    size = np.linalg.norm(force, axis=1)
    onset = int(np.argmax(size))
    while onset > 3 and size[onset - 3 : onset].max() > FREE_FALL_M_S2:
        onset -= 1
    before, after = round(KEPT_BEFORE_S / DROP_STEP_S), round(KEPT_AFTER_S / DROP_STEP_S)
    return force[max(onset - before, 0) : onset + after]


def _triple(values: Any) -> Vector3:
    x, y, z = values
    return float(x), float(y), float(z)
