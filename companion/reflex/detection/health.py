"""Health: whether the detector has data, and what it promises at its present noise. A fault is told, never silent."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from companion.messages import Attitude, ImuSample, Quaternion, Vector3
from companion.motion.config import MOTORS_RAD_S2, STAMP_RESOLUTION_US
from companion.motion.strapdown import VelocityFix
from companion.reflex.config import EXCESS, FusedConfig, StreamHealthConfig
from companion.reflex.detection.fused import FusedState


@dataclass(slots=True)
class StreamHealth:
    """Time and rate of the received IMU samples, on the companion's clock. Changed only by `imu`."""

    started_us: int
    arrivals_us: deque[int] = field(default_factory=deque)
    """Of the samples in the second up to the newest, since the latest silence."""

    def imu(self, samples: int, config: StreamHealthConfig, now_us: int) -> str | None:
        """Take the number of samples that arrived by ``now_us``; after a silence, in which a link held them, as one.

        Returns what is wrong with the stream in one phrase, or None.
        """
        last_heard_us = self.arrivals_us[-1] if self.arrivals_us else self.started_us
        is_silent = now_us - last_heard_us > config.silence_s * 1e6
        if samples:
            if is_silent:
                self.arrivals_us.clear()
            self.arrivals_us.extend([now_us] * (1 if is_silent else samples))
            while now_us - self.arrivals_us[0] >= 1e6:
                self.arrivals_us.popleft()
        elif is_silent:
            return f"no HIGHRES_IMU for {round(config.silence_s * 1e3)} ms"
        rate_hz = len(self.arrivals_us)
        if rate_hz < config.min_rate_hz and now_us - self.started_us >= 1e6:
            return f"HIGHRES_IMU at {rate_hz} Hz, below {config.min_rate_hz:g}"
        return None


@dataclass(slots=True)
class SampleGate:
    """Rejects what the vehicle cannot have measured: an IMU stuck at one value, and an attitude out of reach.

    Stuck: all six axes are equal to the last bit, and the attitude is not. Noise alone changes the last bits of real
    measurements; at rest a simulated sensor without noise may repeat itself. An attitude is out of reach if the vehicle
    cannot have turned to it since the last. One forged or broken one is rejected, and a second one that agrees with it
    accepted, as after a reset of the estimator.
    """

    latest: Attitude | None = None
    rejected: Attitude | None = None
    most_rad_s: float = 0.0  # the largest rate since the latest attitude
    values: tuple[Vector3, Vector3] | None = None  # of the newest IMU sample
    still_wxyz: Quaternion | None = None  # the first attitude since the first of the samples that are equal to it
    is_stuck: bool = False

    def imu(self, sample: ImuSample) -> bool:
        """Take one sample; whether it is accepted."""
        values = (sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s)
        if values != self.values:
            self.values, self.still_wxyz, self.is_stuck = values, None, False
        self.most_rad_s = max(self.most_rad_s, math.hypot(*sample.angular_velocity_frd_rad_s))
        return not self.is_stuck

    def attitude(self, sample: Attitude) -> bool:
        """Take one attitude; whether it is accepted."""
        known = [before for before in (self.latest, self.rejected) if before is not None]
        if known and not any(self._leads_to(before, sample) for before in known):
            self.rejected = sample
            return False
        self.latest, self.rejected, self.most_rad_s = sample, None, 0.0
        self.is_stuck |= self.still_wxyz not in (None, sample.attitude_wxyz)
        self.still_wxyz = self.still_wxyz or sample.attitude_wxyz
        return True

    def _leads_to(self, before: Attitude, sample: Attitude) -> bool:
        """Whether the largest rate, and what motors may have added to it, can turn one into the other."""
        over_s = 1e-6 * (abs(sample.time_boot_us - before.time_boot_us) + STAMP_RESOLUTION_US)
        (a, b, c, d), (w, x, y, z) = before.attitude_wxyz, sample.attitude_wxyz
        turned_rad = 2.0 * math.acos(min(1.0, abs(a * w + b * x + c * y + d * z)))
        return turned_rad <= (self.most_rad_s + MOTORS_RAD_S2 * over_s) * over_s


class Promise(NamedTuple):
    """From where on a hit shows, and how often noise does, if that is Gaussian as it was learnt in this flight."""

    force_m_s2: float  # in a sample that holds it
    jump_m_s: float  # where it falls between the samples; infinite before velocities are known
    false_alarms_per_h: float  # without those by two signs together

    def text(self) -> str:
        jump = f" or {self.jump_m_s:.2f} m/s" if math.isfinite(self.jump_m_s) else ""
        return f"{self.force_m_s2:.1f} m/s^2{jump}, at most {self.false_alarms_per_h:.2g} false alarms an hour"

    def summary(self) -> dict[str, float | None]:
        """As summary.json has it."""
        return {
            "smallest_force_m_s2": round(self.force_m_s2, 3),
            "smallest_jump_m_s": round(self.jump_m_s, 3) if math.isfinite(self.jump_m_s) else None,
            "false_alarms_per_h": float(f"{self.false_alarms_per_h:.3g}"),
        }


def promise_of(
    state: FusedState, config: FusedConfig, fixes: Sequence[VelocityFix], imu_hz: float, resets_are_counted: bool
) -> Promise:
    """From the thresholds and the standard deviations that they are compared with.

    Each of the 3 axes of a velocity adds to its step, by Maxwell.
    """
    side_m_s2 = state.floor.side_m_s2
    per_hour = alarms_per_h(state.threshold_m_s2 / side_m_s2 if side_m_s2 > 0.0 else math.inf, imu_hz)
    if len(fixes) < 2:
        return Promise(state.threshold_m_s2, math.inf, per_hour)
    caution = 1.0 if resets_are_counted else 2.0
    jump_m_s = state.jump.least_m_s(config, caution)
    per_step = 0.0
    if state.jump.variance_m2_s2 > 0.0:
        r = jump_m_s / math.sqrt(state.jump.variance_m2_s2)
        per_step = math.erfc(math.sqrt(0.5) * r) + math.sqrt(2.0 / math.pi) * r * math.exp(-0.5 * r * r)
    velocity_hz = (len(fixes) - 1) * 1e6 / max(fixes[-1].time_boot_us - fixes[0].time_boot_us, 1)
    return Promise(state.threshold_m_s2, jump_m_s, per_hour + 3600.0 * velocity_hz * per_step)


def alarms_per_h(spreads: float, imu_hz: float) -> float:
    """By sideways noise that a threshold of so many learnt spreads exceeds: exp(-r^2/2) of its samples, by Rayleigh."""
    return 3600.0 * imu_hz * math.exp(-0.5 * (EXCESS * spreads) ** 2)
