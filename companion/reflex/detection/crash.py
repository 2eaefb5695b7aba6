"""What shows a crash: a tilt that lasts, rest near the ground, and a weight that no thrust carries."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Sample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import tilt_rad
from companion.motion.settling import Lasting
from companion.motion.vector import ZERO, towards
from companion.reflex import config as reflex


@dataclass(slots=True)
class CrashWatch:
    """Changed only by `update`."""

    tipped: Lasting = field(default_factory=Lasting)
    low: Lasting = field(default_factory=Lasting)  # and still
    lying: Lasting = field(default_factory=Lasting)
    is_near: bool = False  # to the ground, by its last position
    is_carried: bool = False  # not by its thrust, which points along body z
    force_frd_m_s2: Vector3 = ZERO
    rates_frd_rad_s: Vector3 = ZERO

    def update(self, samples: Sequence[Sample], height_m: float | None, landed: LandedState) -> None:
        """`height_m`: above the arming position, None where it is not known."""
        for sample in samples:
            match sample:
                case ImuSample(specific_force_frd_m_s2=f, angular_velocity_frd_rad_s=w):
                    share = reflex.LYING_SHARE
                    self.force_frd_m_s2 = towards(self.force_frd_m_s2, f, share) if self.is_near else f
                    self.rates_frd_rad_s = towards(self.rates_frd_rad_s, w, share) if self.is_near else w
                case Attitude():
                    self.tipped.update(tilt_rad(sample.attitude_wxyz) > reflex.TIPPED_RAD, sample.time_boot_us)
                case LocalPosition():
                    self.is_near = height_m is not None and height_m < reflex.LOW_M
                    is_still = self.is_near and math.hypot(*sample.velocity_ned_m_s) < reflex.RESTS_M_S
                    self.low.update(is_still, sample.time_boot_us)
                    is_weight = abs(math.hypot(*self.force_frd_m_s2) - GRAVITY_M_S2) < reflex.STILL_M_S2
                    self.is_carried = is_weight and -self.force_frd_m_s2[2] < reflex.UPRIGHT_COSINE * GRAVITY_M_S2
                    turns = math.hypot(*self.rates_frd_rad_s) > reflex.STILL_RAD_S
                    lies = self.is_carried or landed is LandedState.ON_GROUND
                    self.lying.update(is_still and lies and not turns, sample.time_boot_us)
