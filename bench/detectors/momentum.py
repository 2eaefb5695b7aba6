"""Detector `momentum`: external force by a generalised-momentum observer.

After F. Ruggiero et al., "Passivity-based control of VToL UAVs with a momentum-based estimator of external wrench and
unmodeled dynamics" (Robotics and Autonomous Systems 72, 2015), and A. De Luca's residual for robot arms. Of the
momentum p = m v the known part is thrust and gravity, so with a gain K (1/s) the residual

    r = K [ p - integral of (m g e3 - T R e3 + r) dt ]      which obeys      r' = K (F_ext - r)

is the external force, low-passed. Per unit mass m cancels: v is the vehicle's velocity estimate and T / m comes from
ATTITUDE_TARGET.thrust, with the gain learnt in flight (see `free_flight`). The sample's force must depart from its
running mean (drag, and the model's error) by the threshold. Nothing of the accelerometer's short peaks is used: it
is as late as the velocity and 1 / K.

Checked: residual, signs and first-order law are those of the observer in LAAS-CNRS's phynt-genom3 (there of the angular
momentum, the known forces being torques), read as program. The article's text was not at hand: whether its estimator
is of a higher order than one was not checked. Gain, threshold, running mean and the learnt thrust are this project's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bench.detectors.contact import Baseline, BaselineState, judge
from companion.messages import ImuSample, LocalPosition, MessageId, Sample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.vector import ZERO
from companion.reflex.detector import Impact, Situation

# Drag changes within a second; the model's error in seconds.
MEAN_MEMORY_S = 1.0
# Velocities further apart leave the observer on its own for too long.
LONGEST_STEP_S = 0.25
# 50 ms: a contact of 20 to 120 ms is followed, and velocities at 50 Hz carry it.
GAIN_PER_S = 20.0


@dataclass(slots=True)
class MomentumState(BaselineState):
    """Adds the observer. NED per unit mass; changed in place."""

    velocity_boot_us: int | None = None
    integral_m_s: Vector3 = ZERO
    residual_m_s2: Vector3 = ZERO
    mean_m_s2: Vector3 = ZERO


class MomentumDetector(Baseline):
    """See the module's text."""

    name, state, looks_at = "momentum", MomentumState, LocalPosition
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "thrust is taken for the accelerometer's mean, so that manoeuvres look like pushes"
    }

    def step(self, state: MomentumState, sample: Sample, situation: Situation) -> tuple[MomentumState, Impact | None]:
        if isinstance(sample, ImuSample):
            elapsed_s = min(max(sample.time_boot_us - state.last_sample_boot_us, 0), 50_000) * 1e-6
            state.last_sample_boot_us = sample.time_boot_us
            state.thrust.learn(sample.time_boot_us, -sample.specific_force_frd_m_s2[2], elapsed_s)
        return super().step(state, sample, situation)

    def look(self, s: MomentumState, sample: LocalPosition, situation: Situation) -> Impact | None:
        """One step of the observer with one velocity."""
        now_us, v, before_us = sample.time_boot_us, sample.velocity_ned_m_s, s.velocity_boot_us
        s.velocity_boot_us = now_us
        dt_s = 0.0 if before_us is None else (now_us - before_us) * 1e-6
        if before_us is None or not 0.0 < dt_s < LONGEST_STEP_S:
            s.integral_m_s, s.residual_m_s2, s.mean_m_s2 = v, ZERO, ZERO
            return None
        lift = s.thrust.expected_m_s2(now_us, -GRAVITY_M_S2)
        n, e, d = body_to_ned(s.attitude_wxyz, (0.0, 0.0, lift))
        known, r, i = (n, e, d + GRAVITY_M_S2), s.residual_m_s2, s.integral_m_s
        s.integral_m_s = i = (
            i[0] + dt_s * (known[0] + r[0]),
            i[1] + dt_s * (known[1] + r[1]),
            i[2] + dt_s * (known[2] + r[2]),
        )
        s.residual_m_s2 = r = (GAIN_PER_S * (v[0] - i[0]), GAIN_PER_S * (v[1] - i[1]), GAIN_PER_S * (v[2] - i[2]))
        push = (r[0] - s.mean_m_s2[0], r[1] - s.mean_m_s2[1], r[2] - s.mean_m_s2[2])
        size = math.sqrt(push[0] ** 2 + push[1] ** 2 + push[2] ** 2)
        is_loud = size >= s.threshold_m_s2
        if not is_loud:
            share = dt_s / MEAN_MEMORY_S
            m = s.mean_m_s2
            s.mean_m_s2 = (m[0] + share * push[0], m[1] + share * push[1], m[2] + share * push[2])
        force = ned_to_body(s.attitude_wxyz, push)
        free_until_us = now_us - round(1e6 / GAIN_PER_S) - round(2e6 * dt_s)
        last_imu_us = s.last_sample_boot_us
        impact = judge(s, now_us, free_until_us, force, size, is_loud, situation.off_reason)
        s.last_sample_boot_us = last_imu_us
        return impact
