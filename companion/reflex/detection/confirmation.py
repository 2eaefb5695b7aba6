"""Confirmation of a hit. The first message that shows it starts a recovery; it counts when other evidence confirms it.

The first piece of evidence is one IMU sample, or one velocity that has jumped. The second is another sample of the
contact's force, or a rate jump that no motor makes, or the vehicle's own velocity and position. A true impulse must
change them. A broken or forged packet does not: the next rates, velocities and positions reject it. An impulse that is
small beside their noise they neither confirm nor reject.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, stdev

from companion.messages import LocalPosition, Vector3
from companion.motion.config import LONGEST_DELAY_US, SHOWN_US
from companion.motion.history import MotionHistory
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO, along, minus, plus
from companion.reflex.config import STRUCK_M_S, SURE
from companion.reflex.detection.detector import Evidence
from companion.reflex.detection.impact import ImpactEstimate


@dataclass(slots=True)
class Hypothesis:
    """A hit that one message shows: an IMU sample's force over its averaging time, or a velocity."""

    time_boot_us: int
    free_until_boot_us: int
    change_m_s: float  # of the velocity
    away: Vector3  # its direction, local NED
    force_m_s2: float = 0.0  # the contact force per mass in the IMU sample
    earlier_boot_us: int | None = None  # time of the sample before; None where a velocity shows the hit
    left_m_s: float = 0.0  # by how much the vehicle's velocity may be wrong by an earlier hit
    later_boot_us: int | None = None  # time of the one after, once it has come

    def follow(self, time_boot_us: int) -> None:
        """Take the newest IMU sample's time."""
        if self.later_boot_us is None and time_boot_us > self.time_boot_us:
            self.later_boot_us = time_boot_us

    def is_rejected(self, fixes: Sequence[VelocityFix], history: MotionHistory, position_noise_m: float) -> bool:
        """Whether velocities show no impulse of this size, or positions no jump of the velocity.

        While an earlier hit is corrected they may show as much by that.
        """
        if 0.5 * self.change_m_s <= self.left_m_s:
            return False
        is_jump = self.earlier_boot_us is None
        return self._is_unmoved(fixes) or (is_jump and self._stays_in_place(history, position_noise_m))

    def _is_unmoved(self, fixes: Sequence[VelocityFix]) -> bool:
        """Whether the velocities before and after show less than half of the change.

        `fixes` have each velocity beside the accelerometer's integral (trapezoids). The sample in question is taken out
        of the integral. After a true impulse the velocity is ahead of it by the whole impulse; otherwise both agree.
        """
        free_us, hit_us, in_sum_m_s, sure = self.free_until_boot_us, self.time_boot_us, 0.0, 0.0
        was = [fix.less_sum_m_s for fix in fixes if free_us - SHOWN_US <= fix.time_boot_us <= free_us]
        came = [fix.less_sum_m_s for fix in fixes if LONGEST_DELAY_US <= fix.time_boot_us - hit_us <= SHOWN_US]
        if len(was) < 2 or len(came) < 2:
            return False
        if self.earlier_boot_us is not None:
            if self.later_boot_us is None:
                return False
            in_sum_m_s = self.force_m_s2 * 0.5e-6 * (self.later_boot_us - self.earlier_boot_us)
            sure = SURE * math.sqrt(1.0 / len(was) + 1.0 / len(came))
        # The median: one of them may be forged. A jump that no sample showed fades from the sum: one velocity shows it.
        change = plus(minus(_median(came), _median(was)), in_sum_m_s, self.away)
        shown = max if self.earlier_boot_us is None else median
        shown_m_s, was_m_s = shown(self._along(came)), median(self._along(was))
        least_m_s = 0.5 * self.change_m_s
        is_unmoved = shown_m_s - was_m_s + in_sum_m_s < least_m_s
        is_clear = least_m_s > sure * stdev(self._along(was))
        # A stuck axis shows no force along itself.
        return is_unmoved and is_clear and math.hypot(*change) < STRUCK_M_S

    def _along(self, vectors: Sequence[Vector3]) -> list[float]:
        return [along(each, self.away) for each in vectors]

    def _stays_in_place(self, history: MotionHistory, position_noise_m: float) -> bool:
        """Whether the positions before and after show less than half of the jump, beyond their noise."""
        free_us, hit_us = self.free_until_boot_us, self.time_boot_us
        was = self._came_m_s(history.between(free_us - SHOWN_US, free_us + 1))
        came = self._came_m_s(history.between(hit_us + 1, hit_us + SHOWN_US + 1))
        least_m_s = 0.5 * self.change_m_s
        if was is None or came is None or least_m_s * SHOWN_US * 1e-6 < SURE * position_noise_m:
            return False
        return came - was < least_m_s

    def _came_m_s(self, places: Sequence[LocalPosition]) -> float | None:
        """Speed of the positions along the jump, m/s; None for too few of them."""
        if not places or places[-1].time_boot_us - places[0].time_boot_us < 0.5 * SHOWN_US:
            return None
        over_s = 1e-6 * (places[-1].time_boot_us - places[0].time_boot_us)
        return along(minus(places[-1].position_ned_m, places[0].position_ned_m), self.away) / over_s


def _median(vectors: Sequence[Vector3]) -> Vector3:
    n, e, d = (median(axis) for axis in zip(*vectors, strict=True))
    return (n, e, d)


def hypothesis_of(
    estimate: ImpactEstimate, force_ned_m_s2: Vector3, averaging_s: float, left_m_s: float
) -> Hypothesis | None:
    """The hypothesis that remains to be confirmed; None where more than one message shows the hit already."""
    impact, size_m_s2 = estimate.impact, math.hypot(*force_ned_m_s2)
    hit_us, free_us = impact.sample_time_boot_us, impact.contact_free_until_boot_us
    if size_m_s2 == 0.0 or impact.is_shown_twice:
        return None
    away = plus(ZERO, 1.0 / size_m_s2, force_ned_m_s2)
    if impact.evidence is Evidence.VELOCITY_JUMP:
        return Hypothesis(hit_us, free_us, size_m_s2 * 1e-6 * (hit_us - free_us), away, left_m_s=left_m_s)
    if estimate.earlier is None:
        return None
    return Hypothesis(
        hit_us, free_us, size_m_s2 * averaging_s, away, size_m_s2, estimate.earlier.time_boot_us, left_m_s
    )
