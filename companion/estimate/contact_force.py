"""The contact force per mass while it lasts: its impulse in NED, its peak, its beginning, whether it was clipped."""

import math
from dataclasses import dataclass, field

from companion.messages import ImuSample, Quaternion, Vector3
from companion.motion.rotation import body_to_ned, turned
from companion.motion.strapdown import ZERO

# Samples at most 1.5 averaging windows apart are contiguous: that is nearer to one window than to two.
CONTIGUOUS = 1.5
# The sensor clips raw samples before they are averaged: a pulse that fills a third of the window and reaches the range
# is a third of the range in the mean.
CLIPPED_SHARE = 1.0 / 3.0
# A contact of no more samples than this is too short to exclude clipping of its raw peak. Ringing below a third of the
# peak, or in another direction, does not count.
SHORT = 2
LASTING_SHARE = 1.0 / 3.0


@dataclass(slots=True)
class ContactForce:
    """Changed only by `add`. Forces per unit mass, m/s^2; impulse per unit mass, m/s."""

    free_frd_m_s2: Vector3
    """The accelerometer's value without the contact."""
    attitude_wxyz: Quaternion
    averaging_us: int
    range_m_s2: float
    started_boot_us: int
    """Latest time without contact."""
    time_boot_us: int = 0
    rates_frd_rad_s: Vector3 = ZERO
    first_rates_frd_rad_s: Vector3 = ZERO
    impulse_ned_m_s: Vector3 = ZERO
    unconfirmed_ned_m_s: Vector3 = ZERO
    last_ned_m_s2: Vector3 = ZERO
    peak_m_s2: float = 0.0
    loud_frd_m_s2: list[Vector3] = field(default_factory=list)
    """The contact force in samples above the threshold."""
    clipped: bool = False
    gap: bool = False
    begun_boot_us: int | None = None

    def add(self, sample: ImuSample, loud: bool) -> None:
        """Take one IMU sample; `loud`: it is above the threshold. Samples after the last such one do not count."""
        now_us, w = sample.time_boot_us, sample.angular_velocity_frd_rad_s
        f, free = sample.specific_force_frd_m_s2, self.free_frd_m_s2
        frd = (f[0] - free[0], f[1] - free[1], f[2] - free[2])
        first = self.time_boot_us == 0
        elapsed_us = now_us - (self.started_boot_us if first else self.time_boot_us)
        contiguous = elapsed_us <= CONTIGUOUS * self.averaging_us
        self.clipped = self.clipped or max(map(abs, f)) >= CLIPPED_SHARE * self.range_m_s2
        if first:
            self.first_rates_frd_rad_s = w
        else:
            p, q, r = self.rates_frd_rad_s
            mean = (0.5 * (p + w[0]), 0.5 * (q + w[1]), 0.5 * (r + w[2]))
            self.attitude_wxyz = turned(self.attitude_wxyz, mean, elapsed_us * 1e-6)
        ned = body_to_ned(self.attitude_wxyz, frd)
        last = ned if contiguous or first else self.last_ned_m_s2
        over_s = 0.5e-6 * (min(elapsed_us, self.averaging_us) if first else elapsed_us)
        sums = self.unconfirmed_ned_m_s
        self.unconfirmed_ned_m_s = (
            sums[0] + over_s * (last[0] + ned[0]),
            sums[1] + over_s * (last[1] + ned[1]),
            sums[2] + over_s * (last[2] + ned[2]),
        )
        self.rates_frd_rad_s = w
        if loud:
            self._confirm(frd, contiguous)
        self.last_ned_m_s2, self.time_boot_us = ned, now_us

    def _confirm(self, force_frd_m_s2: Vector3, contiguous: bool) -> None:
        """Count the sample, and all since the last one above the threshold, as contact."""
        size_m_s2 = math.hypot(*force_frd_m_s2)
        total, more = self.impulse_ned_m_s, self.unconfirmed_ned_m_s
        self.impulse_ned_m_s = (total[0] + more[0], total[1] + more[1], total[2] + more[2])
        self.unconfirmed_ned_m_s = ZERO
        self.loud_frd_m_s2.append(force_frd_m_s2)
        self.peak_m_s2 = max(self.peak_m_s2, size_m_s2)
        self.gap = self.gap or not contiguous
        if len(self.loud_frd_m_s2) == 2 and contiguous and size_m_s2 > 0.0:
            # The contact began within the first window: its mean is that share of the second window's.
            share = min(1.0, math.hypot(*self.loud_frd_m_s2[0]) / size_m_s2)
            self.begun_boot_us = self.time_boot_us - round(share * self.averaging_us)

    @property
    def may_be_clipped(self) -> bool:
        return not self.is_fully_measured

    @property
    def is_lower_bound(self) -> bool:
        return self.gap or self.may_be_clipped

    @property
    def is_fully_measured(self) -> bool:
        """Whether the force so far was measured without clipping, as far as the samples show."""
        x, y, z = max(self.loud_frd_m_s2, key=lambda force: math.hypot(*force), default=ZERO)
        least = LASTING_SHARE * (x * x + y * y + z * z)
        lasting = sum(a * x + b * y + c * z >= least for a, b, c in self.loud_frd_m_s2)
        return not self.clipped and lasting > SHORT

    def turn_rad_s(self) -> float:
        """Change of the body rates since the contact's first sample, rad/s."""
        w, first = self.rates_frd_rad_s, self.first_rates_frd_rad_s
        return math.sqrt((w[0] - first[0]) ** 2 + (w[1] - first[1]) ** 2 + (w[2] - first[2]) ** 2)
