"""The record of one collision: the state at the hit, and what telemetry has shown since."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import LocalPosition, Vector3
from companion.motion.config import LATEST_S, SHOWN_US
from companion.motion.vector import ZERO, along, minus, unit
from companion.reflex.detection.confirmation import Hypothesis
from companion.reflex.detection.detector import DetectorState, Phase
from companion.reflex.detection.impact import ImpactEstimator
from companion.reflex.recovery.laws import Contact, MotionState
from companion.reflex.recovery.motion_estimator import MotionEstimator
from companion.reflex.surface import Normal, away_from, with_change


@dataclass(frozen=True, slots=True)
class CollisionReport:
    """One collision, as the companion measured it from telemetry. Positions are the vehicle's local NED."""

    detected_at_us: int
    sample_time_boot_us: int
    detector: str
    position_ned_m: Vector3
    impact_velocity_ned_m_s: Vector3  # v_c of the paper: just before contact
    impact_speed_m_s: float
    normal_ned: Vector3  # unit vector out of the obstacle, by the whole contact; horizontal unless that is steep
    peak_specific_force_m_s2: float  # of the contact alone, the largest in one IMU sample
    recovery_setpoint_ned_m: Vector3
    settled_after_s: float | None  # from the hit to the start of the interval in which it stayed settled; None: not
    overshoot_m: float  # largest distance past the setpoint, away from the obstacle, until the recovery ended
    rebound_speed_m_s: float | None
    """Largest speed along the normal until 0.1 s after the contact; 0 when it never moved back, None when the vehicle's
    velocity was not valid then (a clipped hit)."""


@dataclass(slots=True)
class CollisionRecord:
    """Positions and velocities in local NED; boot times in the vehicle's clock."""

    detected_at_us: int
    detector: str
    peak_specific_force_m_s2: float
    estimator: MotionEstimator
    source: ImpactEstimator
    setpoint_ned_m: Vector3 = ZERO  # where to rest, as its recovery has it now
    hypothesis: Hypothesis | None = None  # until it is confirmed or rejected
    settled_after_s: float | None = None  # from its first sample to the beginning of its rest
    is_over: bool = False  # settled, or given up on
    overshoot_m: float = 0.0
    rebound_speed_m_s: float | None = None  # the largest along the normal, until the rebound is over

    @property
    def contact(self) -> Contact:
        return self.estimator.contact

    @property
    def normal(self) -> Normal:
        """The obstacle's normal by all that is known now."""
        before_m_s, estimator = self.contact.velocity_ned_m_s, self.estimator
        error_m_s = math.hypot(self.contact.velocity_error_m_s, estimator.after_error_m_s)
        normal = with_change(estimator.normal, before_m_s, estimator.after_ned_m_s, error_m_s)
        return Normal(away_from(normal.direction_ned), normal.error_rad)

    def follow(self, state: DetectorState) -> None:
        """Take the newest sample; the contact's largest force while it lasts."""
        strapdown, estimate, hit_us = self.source.strapdown, self.source.estimate, self.estimator.hit_boot_us
        # In these phases the state still describes the contact.
        is_in_contact = state.phase in (Phase.CONTACT, Phase.ARMED)
        # A velocity that shows it may have come before the sample of the same time.
        is_larger = state.peak_specific_force_m_s2 > self.peak_specific_force_m_s2
        is_seen_again = is_in_contact and (is_larger or state.last_loud_boot_us > hit_us)
        if self.hypothesis is not None:
            is_turned = self.hypothesis.follow(strapdown.time_boot_us, strapdown.rates_frd_rad_s)
            self.hypothesis = None if is_turned or is_seen_again else self.hypothesis
        if is_in_contact and estimate is not None and estimate.impact.sample_time_boot_us == hit_us:
            self.peak_specific_force_m_s2 = max(self.peak_specific_force_m_s2, state.peak_specific_force_m_s2)

    def is_rejected(self, now_boot_us: int) -> bool:
        """Whether the hit is rejected, once the time to the decision is over: only its first sample shows it."""
        if self.hypothesis is None or now_boot_us - self.estimator.hit_boot_us < SHOWN_US:
            return False
        hypothesis, source, self.hypothesis = self.hypothesis, self.source, None
        return hypothesis.is_rejected(source.strapdown.fixes, source.history, source.config.position_noise_m)

    def follow_recovery(self, sample: LocalPosition) -> None:
        """Update overshoot and rebound speed while the vehicle recovers."""
        estimator, normal = self.estimator, self.normal.direction_ned
        shown: MotionState | LocalPosition = estimator.motion if estimator.has_converged else sample
        away = unit(minus(self.setpoint_ned_m, self.contact.position_ned_m))
        past_m = along(minus(shown.position_ned_m, self.setpoint_ned_m), normal if away == ZERO else away)
        self.overshoot_m = max(self.overshoot_m, past_m)
        # A velocity, which may be late, shows the rebound; later the vehicle's own controller makes it.
        if sample.time_boot_us - estimator.pushed_boot_us <= LATEST_S * 1e6:
            self.rebound_speed_m_s = max(self.rebound_speed_m_s or 0.0, along(shown.velocity_ned_m_s, normal))

    def report(self) -> CollisionReport:
        velocity = self.contact.velocity_ned_m_s
        return CollisionReport(
            detected_at_us=self.detected_at_us,
            sample_time_boot_us=self.estimator.hit_boot_us,
            detector=self.detector,
            position_ned_m=self.contact.position_ned_m,
            impact_velocity_ned_m_s=velocity,
            impact_speed_m_s=math.hypot(*velocity),
            normal_ned=self.normal.direction_ned,
            peak_specific_force_m_s2=self.peak_specific_force_m_s2,
            recovery_setpoint_ned_m=self.setpoint_ned_m,
            settled_after_s=self.settled_after_s,
            overshoot_m=self.overshoot_m,
            rebound_speed_m_s=self.rebound_speed_m_s,
        )


def recoveries_from(hits: Sequence[CollisionRecord]) -> int:
    """How many recoveries they began: what is touched again before the vehicle has settled is the same hit."""
    return sum(hit.is_over for hit in hits[:-1]) + bool(hits)
