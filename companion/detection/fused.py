"""Detector `fused`, the default: an unexplained external force, or a velocity jump after an unseen contact.

By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z and drag on x and y. Three signs show a
contact, each compared with this vehicle's own flight:

* horizontal: f_x, f_y differ from their running mean and from zero, with an allowance for drag on a turning vehicle;
* vertical: f_z is outside the range of the propellers, from zero to their maximum (see `thrust`). A failed motor, free
  fall, a dropped payload and every manoeuvre stay inside;
* the velocity jumps and the accelerometer does not show it (see `velocity_jump`). The threshold is lower beside a rate
  jump.

`classify` names the kind. A weak force on a hovering vehicle is observed for a moment before it counts as a hit or a
hand (see `soft_contact`).
"""

import math
from collections.abc import Mapping
from typing import ClassVar

from companion.detection.classify import kind_of
from companion.detection.force_noise import SETTLED_US
from companion.detection.force_signs import (
    CLEAR,
    SHAKING,
    side_threshold_m_s2,
    together_m_s2,
    vertical_threshold_m_s2,
)
from companion.detection.fused_config import FusedConfig
from companion.detection.fused_state import FusedState
from companion.detection.interface import ON_THE_GROUND, Evidence, Impact, ImpactKind, Phase, Situation
from companion.detection.velocity_jump import VelocityJump
from companion.messages import AttitudeTarget, ImuSample, LocalPosition, MessageId, Odometry, Sample, Vector3
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.strapdown import LEVEL

# A contact longer than springs take to bottom out, whose force then exceeds its peak by half, is another hit: a vehicle
# scrapes along the ground and then strikes it.
WORSE_AFTER_US = 100_000
WORSE = 1.5
# For this time after a hit the velocity threshold is larger by this factor, because the estimator corrects the part it
# missed. That holds for every hit: a slow stream samples a quarter of the time and cannot exclude a hidden part. The
# corrections reach 0.25 m/s (random missions at 50 Hz); a second hit of 0.5 m/s makes twice that.
SWING_US, SWINGING = 1_500_000, 3.0


class FusedDetector:
    """See the module's text."""

    name = "fused"
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "a force from below counts only beyond 5 g",
        MessageId.VIBRATION: "a clipped peak is recognised by its size alone",
        MessageId.ODOMETRY: "resets of the estimator look like hits, so a velocity jump must be twice as large",
    }

    def __init__(self, config: FusedConfig, averaging_interval_us: int) -> None:
        self._config = config
        self._averaging_us = averaging_interval_us
        self._rearm_us = round(config.rearm_quiet_s * 1e6)
        self._longest_us = round(config.longest_contact_s * 1e6)
        self._rest_us = round(config.velocity_rest_s * 1e6)
        self._soft_us = round(config.soft_wait_s * 1e6)

    def initial(self) -> FusedState:
        return FusedState(threshold_m_s2=self._config.side_threshold_m_s2, jump=VelocityJump(self._averaging_us))

    def step(self, state: FusedState, sample: Sample, situation: Situation) -> tuple[FusedState, Impact | None]:
        if type(sample) is ImuSample:
            impact = self._imu(state, sample, situation)
            state.soft.imu(state.last_sample_boot_us, sample.specific_force_frd_m_s2)
            return state, impact
        if isinstance(sample, LocalPosition | Odometry):
            return state, self._velocity(state, sample, situation)
        if isinstance(sample, AttitudeTarget):
            state.thrust.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        return state, None

    # --- force ------------------------------------------------------------------------------------------------

    def _imu(self, s: FusedState, sample: ImuSample, situation: Situation) -> Impact | None:
        config, now_us = self._config, sample.time_boot_us
        f, w = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
        before_us = s.previous_sample_boot_us = s.last_sample_boot_us
        s.last_sample_boot_us = now_us
        s.jump.imu(before_us, now_us, w)
        f_x, f_y, f_z = f
        off = situation.why_off
        x, y = f_x - s.floor.x, f_y - s.floor.y
        # Compared with zero, too: the end of a long force, which the mean has learnt, is no hit.
        side = math.sqrt(min(x * x + y * y, f_x * f_x + f_y * f_y))
        room = vertical_threshold_m_s2(s, config)
        most = s.thrust.most_m_s2(now_us)
        below, above = f_z - room, -f_z - most - room
        if s.threshold_m_s2 > SHAKING * config.side_threshold_m_s2:
            together, side = together_m_s2(s, f), side / CLEAR
            if together > side:
                side, s.previous_sample_boot_us = together, s.soft.before_us
        is_within = side < s.threshold_m_s2 and below < 0.0 and above < 0.0
        if is_within and off is None and s.phase is Phase.ARMED:
            # Nearly every sample ends here.
            s.soft.since_boot_us = None
            self._learn(s, f, before_us)
            return None
        if off is not None:
            s.phase, s.off_reason = Phase.OFF, off
            self._learn(s, f, before_us)
            return None
        threshold = side_threshold_m_s2(s, config, w)
        if side < threshold and below < 0.0 and above < 0.0:
            self._quiet(s, f, before_us)
            return None
        force = (x, y, f_z - s.thrust.expected_m_s2(now_us, s.floor.z))
        size = math.sqrt(x * x + y * y + force[2] * force[2])
        ratio = max(side / threshold, 1.0 + max(below, above) / room)
        return self._loud(s, sample, situation, force, size, ratio)

    def _learn(self, s: FusedState, f: Vector3, before_us: int) -> None:
        now_us = s.last_sample_boot_us
        elapsed_s = (now_us - before_us) * 1e-6
        if not 0.0 < elapsed_s < 1.0:
            elapsed_s = 0.001
        s.floor.learn(f[0], f[1], f[2], elapsed_s)
        if s.phase is Phase.ARMED:
            s.thrust.learn(now_us, f[2], elapsed_s)
        s.threshold_m_s2 = max(self._config.side_threshold_m_s2, self._config.noise_factor * s.floor.side_m_s2)

    def _quiet(self, s: FusedState, f: Vector3, before_us: int) -> None:
        now_us = s.last_sample_boot_us
        s.soft.since_boot_us = None
        self._learn(s, f, before_us)
        if s.phase is Phase.OFF:
            self._switched_on(s)
        elif s.phase is not Phase.ARMED and now_us - s.last_loud_boot_us >= self._rearm_us:
            s.phase = Phase.ARMED if s.floor.is_known else Phase.QUIET

    def _switched_on(self, s: FusedState) -> None:
        """Begin a quiet interval; after the ground it begins SETTLED_US later."""
        now_us = s.contact_began_boot_us = s.last_sample_boot_us
        s.last_loud_boot_us = now_us + SETTLED_US if s.off_reason == ON_THE_GROUND else now_us
        s.phase, s.off_reason = Phase.QUIET, ""

    def _loud(
        self, s: FusedState, sample: ImuSample, situation: Situation, force: Vector3, size: float, ratio: float
    ) -> Impact | None:
        now_us, soft = s.last_sample_boot_us, s.soft
        f, turn = sample.specific_force_frd_m_s2, s.jump.newest_rate_step_rad_s
        jumps = soft.turns(now_us, turn) or soft.jumps(now_us, f, s.threshold_m_s2)
        if s.phase is Phase.CONTACT:
            s.last_loud_boot_us = now_us
            is_another = jumps if soft.is_hand else now_us - s.contact_began_boot_us > WORSE_AFTER_US
            if is_another and size > WORSE * s.peak_specific_force_m_s2:
                return self._fire(s, now_us, situation, force, s.previous_sample_boot_us, Evidence.FORCE, 1.0)
            s.peak_specific_force_m_s2 = max(s.peak_specific_force_m_s2, size)
            if now_us - s.contact_began_boot_us > self._longest_us:
                self._learn(s, f, now_us - 1)
            return None
        if s.phase is not Phase.ARMED:
            # Switched on during vibration: it is learnt too, or too low a threshold would never rise.
            if s.phase is Phase.OFF:
                self._switched_on(s)
            waited = now_us - s.contact_began_boot_us > self._longest_us and s.floor.is_known
            s.phase, s.last_loud_boot_us = Phase.ARMED if waited else Phase.QUIET, max(now_us, s.last_loud_boot_us)
            self._learn(s, f, now_us - 1)
            return None
        free_until_us = min(now_us - self._averaging_us, s.previous_sample_boot_us)
        if soft.since_boot_us is not None:
            free_until_us = soft.free_until_us
        kind = None
        if size < self._config.soft_m_s2 and soft.may_be_hand(now_us) and not jumps:
            if soft.looked_at_us(now_us, free_until_us) < self._soft_us:
                return None
            kind = ImpactKind.CONTACT
        return self._fire(s, now_us, situation, force, free_until_us, Evidence.FORCE, min(1.0, 0.5 * ratio), kind)

    def _fire(
        self,
        s: FusedState,
        now_us: int,
        situation: Situation,
        force: Vector3,
        free_until_us: int,
        evidence: Evidence,
        confidence: float,
        kind: ImpactKind | None = None,
    ) -> Impact:
        if kind is None:
            attitude = LEVEL if situation.inertial is None else situation.inertial.strapdown.attitude_wxyz
            n, e, d = body_to_ned(attitude, force)
            over_s = max(now_us - free_until_us, 1) * 1e-6
            impulse = (n * over_s, e * over_s, d * over_s)
            kind = kind_of(impulse, s.velocity_ned_m_s, s.jump.rate_step_near(now_us), situation)
        s.phase, s.off_reason = Phase.CONTACT, ""
        s.last_loud_boot_us = s.contact_began_boot_us = now_us
        s.peak_specific_force_m_s2 = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
        s.soft.fired(now_us, kind is ImpactKind.CONTACT)
        if kind is not ImpactKind.CONTACT:
            s.hit_boot_us = now_us
        return Impact(now_us, free_until_us, force, kind, evidence, confidence)

    # --- velocity ---------------------------------------------------------------------------------------------

    def _velocity(self, s: FusedState, sample: LocalPosition | Odometry, situation: Situation) -> Impact | None:
        time_us, jump, config, inertial = sample.time_boot_us, s.jump, self._config, situation.inertial
        s.velocity_ned_m_s = v = sample.velocity_ned_m_s
        s.soft.velocity(time_us, v)
        if inertial is None or not inertial.has_new_fix:
            return None
        step = jump.step_m_s(inertial.fixes)
        rests = time_us - s.last_loud_boot_us < self._rest_us or not situation.estimate_valid
        if s.phase is Phase.CONTACT or rests:
            jump.since_us = time_us
            return None
        if step is None:
            return None
        spread_m_s = jump.spread_m_s
        jump.learn(step)
        size, least = math.hypot(*step), self._least_jump_m_s(s, time_us, spread_m_s, type(sample) is Odometry)
        if s.phase is not Phase.ARMED or size < least:
            return None
        jump.since_us = time_us
        now_us, free_until_us = max(time_us, s.last_sample_boot_us), jump.free_until_us(time_us, config.rate_step_rad_s)
        over_s = max(now_us - free_until_us, 1) * 1e-6
        push = (step[0] / over_s, step[1] / over_s, step[2] / over_s)
        force = ned_to_body(inertial.strapdown.attitude_wxyz, push)
        s.velocity_ned_m_s = (v[0] - step[0], v[1] - step[1], v[2] - step[2])
        confidence = min(1.0, 0.5 * size / least)
        return self._fire(s, now_us, situation, force, free_until_us, Evidence.VELOCITY_JUMP, confidence)

    def _least_jump_m_s(self, s: FusedState, time_us: int, spread_m_s: float, counts_resets: bool) -> float:
        """Threshold of a velocity jump, m/s; larger where the estimate may jump without a hit."""
        config, jump = self._config, s.jump
        caution = 1.0 if counts_resets else 2.0
        if s.hit_boot_us is not None and time_us - s.hit_boot_us < SWING_US:
            caution *= SWINGING
        turned = jump.rate_step_near(time_us) >= config.rate_step_rad_s
        least = config.velocity_step_turned_m_s if turned else config.velocity_step_m_s
        p, q, _ = jump.rates_frd_rad_s
        shaking = max(0.0, s.floor.side_m_s2 - config.side_threshold_m_s2 / config.noise_factor)
        noise_m_s, room = config.noise_factor * spread_m_s, config.velocity_per_rate_m * (abs(p) + abs(q))
        unseen_m_s = jump.unseen_m_s(shaking, abs(s.soft.last[2] - s.floor.z))
        if jump.no_motor_turns(time_us, config.rate_step_rad_s):
            # Two signs confirm each other: half the noise is enough, and the thrust has turned for a moment only.
            noise_m_s, unseen_m_s, room = 0.5 * noise_m_s, 0.5 * unseen_m_s, 0.0
        if jump.is_slow:
            least = config.velocity_step_slow_m_s
        return caution * max(least, noise_m_s) + unseen_m_s + room
