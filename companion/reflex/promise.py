"""What the detector promises at its present noise: the smallest hit that shows, and false alarms an hour."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from companion.motion.strapdown import VelocityFix
from companion.reflex.config import EXCESS, FusedConfig
from companion.reflex.force_signs import FusedState


class Promise(NamedTuple):
    """Of Gaussian noise as it was learnt in this flight; a false alarm by anything else is not in it.

    A hit shows from `force_m_s2` on in a sample that holds it, and from `jump_m_s` on where it falls between the
    samples: infinite before velocities are known.
    """

    force_m_s2: float
    jump_m_s: float
    false_alarms_per_h: float

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

    Sideways noise exceeds a threshold of r standard deviations with exp(-r^2/2), by Rayleigh; each of the 3 axes of a
    velocity adds to its step, by Maxwell.
    """
    per_sample = math.exp(-0.5 * _ratio(EXCESS * state.threshold_m_s2, state.floor.side_m_s2) ** 2)
    per_hour = 3600.0 * imu_hz * per_sample
    if not state.jump.known or len(fixes) < 2:
        return Promise(state.threshold_m_s2, math.inf, per_hour)
    caution = 1.0 if resets_are_counted else 2.0
    jump_m_s = state.jump.least_m_s(config, fixes[-1].time_boot_us, caution, 0.0, 0.0)
    r = _ratio(jump_m_s, math.sqrt(state.jump.variance_m2_s2))
    per_step = 0.0
    if math.isfinite(r):
        per_step = math.erfc(math.sqrt(0.5) * r) + math.sqrt(2.0 / math.pi) * r * math.exp(-0.5 * r * r)
    velocity_hz = (len(fixes) - 1) * 1e6 / max(fixes[-1].time_boot_us - fixes[0].time_boot_us, 1)
    return Promise(state.threshold_m_s2, jump_m_s, per_hour + 3600.0 * velocity_hz * per_step)


def _ratio(threshold: float, spread: float) -> float:
    return threshold / spread if spread > 0.0 else math.inf
