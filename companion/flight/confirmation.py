"""Confirmation of a hit. The first message starts a recovery at once; the hit counts when other evidence confirms it.

The first piece of evidence is one IMU sample or one velocity. The second is another sample of the contact's force, or a
change of the vehicle's own velocity. A true impulse changes the velocity. A broken or forged packet does not.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from companion.detection.interface import Evidence
from companion.estimate.impact import ImpactEstimate
from companion.messages import LocalPosition, Vector3
from companion.motion.history import MotionHistory
from companion.motion.inertial import VelocityFix, less_sum
from companion.reflex.halfspace import plus
from companion.reflex.planner import REST

# Time to the decision, and of the velocities before. All but the longest contacts are over by then (0.12 s at 1 m/s),
# and the vehicle's estimate is 20 to 40 ms late. A tilt of 17 degrees for this time moves a vehicle by 3 cm.
DECIDED_US = 150_000
# A hit that matters changes the velocity by more than this; noise alone reaches 0.1 m/s now and then.
HIT_LEAVES_M_S = 0.15
# Standard deviations of the places' noise that a rejection needs.
SURE = 3.0


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A hit that one message shows. Boot times; impulses per mass in local NED."""

    time_boot_us: int
    free_until_boot_us: int
    impulse_ned_m_s: Vector3
    in_sum_ned_m_s: Vector3  # what the accelerometer's integral has of it: nothing where a velocity shows it

    @property
    def least_m_s(self) -> float:
        """The least change of the velocity that confirms the hit."""
        return 0.5 * max(math.hypot(*self.impulse_ned_m_s), HIT_LEAVES_M_S)

    def is_rejected(self, fixes: Sequence[VelocityFix], places: MotionHistory, position_noise_m: float) -> bool:
        """Whether no change of the velocity shows the impulse, or the places do not follow it."""
        return self._is_unmoved(fixes) or self._stays_in_place(places, position_noise_m)

    def _is_unmoved(self, fixes: Sequence[VelocityFix]) -> bool:
        """The sample in question is taken out of the integral: after a true impulse the velocity is ahead by that.

        Medians: one velocity may be forged, and the first ones after a hit are late.
        """
        free_us, hit_us = self.free_until_boot_us, self.time_boot_us
        was = [less_sum(fix) for fix in fixes if free_us - DECIDED_US <= fix.time_boot_us <= free_us]
        came = [less_sum(fix) for fix in fixes if hit_us < fix.time_boot_us <= hit_us + DECIDED_US]
        if len(was) < 2 or len(came) < 2:
            return False
        change = plus(plus(_median(came), -1.0, _median(was)), 1.0, self.in_sum_ned_m_s)
        # In any direction: a stuck axis shows no force along itself.
        return math.hypot(*change) < self.least_m_s

    def _stays_in_place(self, history: MotionHistory, position_noise_m: float) -> bool:
        """Whether the places before and after a velocity that jumped show less of it, beyond their noise."""
        free_us, hit_us, least_m_s = self.free_until_boot_us, self.time_boot_us, self.least_m_s
        was = _velocity(history.between(free_us - DECIDED_US, free_us + 1))
        came = _velocity(history.between(hit_us + 1, hit_us + DECIDED_US + 1))
        is_hidden = self.in_sum_ned_m_s != REST or least_m_s * DECIDED_US * 1e-6 < SURE * position_noise_m
        return was is not None and came is not None and not is_hidden and math.dist(came, was) < least_m_s


def _velocity(places: Sequence[LocalPosition]) -> Vector3 | None:
    """Of the positions, m/s; None for too few of them."""
    lasted_s = 1e-6 * (places[-1].time_boot_us - places[0].time_boot_us) if places else 0.0
    if lasted_s < 0.5e-6 * DECIDED_US:
        return None
    return plus(REST, 1.0 / lasted_s, plus(places[-1].position_ned_m, -1.0, places[0].position_ned_m))


def _median(vectors: Iterable[Vector3]) -> Vector3:
    n, e, d = (median(axis) for axis in zip(*vectors, strict=True))
    return (n, e, d)


def hypothesis_of(estimate: ImpactEstimate, force_ned_m_s2: Vector3, averaging_s: float) -> Hypothesis | None:
    """The hypothesis that remains to be confirmed; None where more than one message shows the hit already."""
    hit_us, free_us = estimate.impact.sample_time_boot_us, estimate.impact.contact_free_until_boot_us
    if estimate.is_final:
        return None
    lasted_s = averaging_s if estimate.impact.evidence is Evidence.FORCE else 1e-6 * (hit_us - free_us)
    in_sum = plus(REST, estimate.integrated_s, force_ned_m_s2)
    return Hypothesis(hit_us, free_us, plus(REST, lasted_s, force_ned_m_s2), in_sum)
