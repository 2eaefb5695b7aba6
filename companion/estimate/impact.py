"""What is known of an impact: at once, better while the contact lasts, final when it is over."""

import math
from dataclasses import dataclass, field, replace

from companion.detection.interface import DetectorState, Impact, ImpactKind, Phase
from companion.estimate.collision import BATCH_US, STAMP_RESOLUTION_US, ContactMotion, motion_before_contact
from companion.estimate.history import MotionHistory
from companion.estimate.rotation import body_to_ned
from companion.messages import Attitude, LocalPosition, Quaternion, Sample, Vector3
from companion.mission.config import EstimateConfig

# Attitude streams are required, so this is only for a hit before the first one: level, nose north.
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
# In these phases a detector's state still describes the contact it fired on.
IN_OR_AFTER_CONTACT = (Phase.CONTACT, Phase.ARMED)


@dataclass(frozen=True, slots=True)
class ImpactEstimate:
    """One impact. Times are the vehicle's boot clock, vectors local NED, SI.

    `time_boot_us` is t_c, good to `time_error_us` either way; `velocity_ned_m_s` is v_c, the velocity just before
    it. `normal_ned` is the unit direction of the obstacle's push. `impulse_m_s` is the contact's impulse per unit
    mass. `peak_specific_force_m_s2` is the largest in one IMU sample. `is_lower_bound`: the sensor clipped, or part
    of the contact was not seen, and both may be larger. `is_final`: the contact is over.
    """

    impact: Impact
    time_boot_us: int
    time_error_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    normal_ned: Vector3
    peak_specific_force_m_s2: float
    impulse_m_s: float
    is_lower_bound: bool
    kind: ImpactKind
    confidence: float
    is_final: bool


@dataclass(slots=True)
class ImpactEstimator:
    """Listens to all samples; from an impact on it knows more with each of them. Times: vehicle's boot clock."""

    config: EstimateConfig
    history: MotionHistory = field(default_factory=MotionHistory)
    attitude_wxyz: Quaternion = LEVEL
    estimate: ImpactEstimate | None = None
    contact_ended_boot_us: int = 0

    def hear(self, sample: Sample) -> None:
        if isinstance(sample, LocalPosition):
            self.history.add(sample)
        elif isinstance(sample, Attitude):
            self.attitude_wxyz = sample.attitude_wxyz

    def begin(self, impact: Impact) -> ImpactEstimate:
        """A new impact: what was known just before it."""
        free_until_us = impact.contact_free_until_boot_us
        motion = self._motion(impact)
        strength = math.hypot(*impact.specific_force_frd_m_s2)
        self.contact_ended_boot_us = impact.sample_time_boot_us
        self.estimate = estimate = ImpactEstimate(
            impact=impact,
            time_boot_us=motion.time_boot_us,
            time_error_us=impact.sample_time_boot_us - free_until_us,
            position_ned_m=motion.position_ned_m,
            velocity_ned_m_s=motion.velocity_ned_m_s,
            normal_ned=unit(body_to_ned(self.attitude_wxyz, impact.specific_force_frd_m_s2)),
            peak_specific_force_m_s2=strength,
            impulse_m_s=strength * 1e-6 * (impact.sample_time_boot_us - free_until_us),
            is_lower_bound=False,
            kind=impact.kind,
            confidence=impact.confidence,
            is_final=False,
        )
        return estimate

    def follow(self, state: DetectorState) -> ImpactEstimate | None:
        """After each IMU sample: its share in the present contact; the final estimate when that is over."""
        estimate = self.estimate
        if estimate is None or estimate.is_final or state.phase not in IN_OR_AFTER_CONTACT:
            return None
        is_final = state.phase is not Phase.CONTACT
        if state.last_loud_boot_us > self.contact_ended_boot_us or is_final:
            self.contact_ended_boot_us = state.last_loud_boot_us
            self.estimate = replace(
                estimate,
                normal_ned=unit(body_to_ned(self.attitude_wxyz, state.force_sum_frd_m_s2)),
                peak_specific_force_m_s2=state.peak_specific_force_m_s2,
                is_final=is_final,
            )
        return self.estimate if is_final else None

    def _motion(self, impact: Impact) -> ContactMotion:
        """From the history before this contact and after the one before it."""
        contact_us = impact.contact_free_until_boot_us
        start_us = contact_us - BATCH_US
        if self.estimate is not None:
            start_us = max(start_us, self.contact_ended_boot_us + STAMP_RESOLUTION_US)
        samples = self.history.between(start_us, contact_us)
        motion = motion_before_contact(samples, contact_us, self.config)
        if motion is not None:
            return motion
        latest = self.history.latest()
        if latest is None:
            return ContactMotion(contact_us, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return ContactMotion(latest.time_boot_us, latest.position_ned_m, latest.velocity_ned_m_s)


def unit(vector: Vector3) -> Vector3:
    """Direction; zero when there is none."""
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length, vector[2] / length) if length > 0.0 else (0.0, 0.0, 0.0)
