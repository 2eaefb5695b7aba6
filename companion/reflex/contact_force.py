"""The contact force per mass while it lasts: impulse in NED, peak, beginning, whether it was measured whole."""

import math
from dataclasses import dataclass, field

from companion.messages import ImuSample, Quaternion, Vector3
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO
from companion.reflex.config import CLIPPED_SHARE, SHORT


@dataclass(slots=True)
class ContactForce:
    """Changed only by `add`. Forces per unit mass, m/s^2; impulse per unit mass, m/s."""

    free_frd_m_s2: Vector3
    """The accelerometer's value without the contact."""
    averaging_us: int
    range_m_s2: float
    impulse_ned_m_s: Vector3 = ZERO
    forces_ned_m_s2: list[Vector3] = field(default_factory=list)
    """The contact force in samples above the threshold."""
    is_clipped: bool = False
    has_gap: bool = False
    """Whether samples are missing; PX4's own estimate does not lack them."""
    begun_boot_us: int | None = None

    def add(self, sample: ImuSample, elapsed_us: int, attitude_wxyz: Quaternion) -> None:
        """Take one IMU sample above the threshold, so long after the one before it, and the attitude at its time.

        The first one comes so long after the latest time without contact.
        """
        f, free, (n, e, d) = sample.specific_force_frd_m_s2, self.free_frd_m_s2, self.impulse_ned_m_s
        force = x, y, z = body_to_ned(attitude_wxyz, (f[0] - free[0], f[1] - free[1], f[2] - free[2]))
        # Of the time before the first sample only its own window is known.
        elapsed_s = 1e-6 * (elapsed_us if self.forces_ned_m_s2 else min(elapsed_us, self.averaging_us))
        is_contiguous = elapsed_us < 2 * self.averaging_us  # less than one window is missing
        self.has_gap |= not is_contiguous
        self.is_clipped |= max(map(abs, f)) >= CLIPPED_SHARE * self.range_m_s2
        self.impulse_ned_m_s = (n + elapsed_s * x, e + elapsed_s * y, d + elapsed_s * z)
        self.forces_ned_m_s2.append(force)
        if len(self.forces_ned_m_s2) == 2 and is_contiguous:
            # The contact began within the first window: its mean is that share of the second window's.
            first_m_s2, second_m_s2 = (math.hypot(*each) for each in self.forces_ned_m_s2)
            share = min(1.0, first_m_s2 / second_m_s2) if second_m_s2 > 0.0 else 1.0
            self.begun_boot_us = sample.time_boot_us - elapsed_us - round(share * self.averaging_us)

    @property
    def peak_m_s2(self) -> float:
        return max(math.hypot(*force) for force in self.forces_ned_m_s2)

    @property
    def is_fully_measured(self) -> bool:
        """Whether the force so far was measured without clipping, as far as the samples show."""
        x, y, z = max(self.forces_ned_m_s2, key=lambda force: math.hypot(*force))
        least = 0.5 * (x * x + y * y + z * z)
        lasting = sum(a * x + b * y + c * z >= least for a, b, c in self.forces_ned_m_s2)
        return not self.is_clipped and lasting > SHORT
