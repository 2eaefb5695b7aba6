"""Stream health: whether the detector has data. A fault of the streams is reported, never silent."""

import math
from collections import deque
from dataclasses import dataclass, field

from companion.messages import Attitude, ImuSample, Quaternion, Vector3
from companion.motion.config import MOTORS_RAD_S2, STAMP_RESOLUTION_US
from companion.reflex.config import StreamHealthConfig


@dataclass(slots=True)
class StreamHealth:
    """Time and rate of the received IMU samples, on the companion's clock. Changed only by `imu`."""

    started_us: int
    last_heard_us: int
    arrivals_us: deque[int] = field(default_factory=deque)
    """Of the samples in the second up to the newest, since the latest silence."""

    def imu(self, samples: int, config: StreamHealthConfig, now_us: int) -> None:
        """Take the number of samples that arrived by ``now_us``; after a silence, in which a link held them, as one."""
        if samples and now_us - self.last_heard_us > config.silence_s * 1e6:
            self.arrivals_us.clear()
            samples = 1
        if not samples:
            return
        self.last_heard_us = now_us
        self.arrivals_us.extend([now_us] * samples)
        while now_us - self.arrivals_us[0] >= 1e6:
            self.arrivals_us.popleft()

    def fault(self, config: StreamHealthConfig, now_us: int) -> str | None:
        """What is wrong with the stream in one phrase, or None."""
        if now_us - self.last_heard_us > config.silence_s * 1e6:
            return f"no HIGHRES_IMU for {round(config.silence_s * 1e3)} ms"
        rate_hz = len(self.arrivals_us)
        if rate_hz < config.min_rate_hz and now_us - self.started_us >= 1e6:
            return f"HIGHRES_IMU at {rate_hz} Hz, below {config.min_rate_hz:g}"
        return None


@dataclass(slots=True)
class SampleGate:
    """Rejects what the vehicle cannot have measured: an IMU stuck at one value, and an attitude out of reach.

    Stuck: all six axes are equal to the last bit, and the attitude is not. Noise alone changes the last bits of real
    measurements; at rest a simulated sensor without noise may repeat itself.

    An attitude is out of reach if the vehicle cannot have turned to it since the last. A second one that agrees with a
    rejected one is accepted, as after a reset of the estimator. So one forged or broken message does not disturb the
    integrated accelerometer.
    """

    latest: Attitude | None = None
    rejected: Attitude | None = None
    most_rad_s: float = 0.0
    """The largest rate since the latest attitude."""
    values: tuple[Vector3, Vector3] | None = None
    """Of the newest IMU sample."""
    still_wxyz: Quaternion | None = None
    """The first attitude since the first of the samples that are equal to it."""
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
