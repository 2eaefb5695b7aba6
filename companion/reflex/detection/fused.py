"""Detector `fused`, the default: an unexplained external force, or the jump that an unseen contact leaves.

By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z and drag on x and y. Four signs show a
contact, each compared with this vehicle's own flight:

* horizontal: f_x, f_y differ from their running mean and from zero, with an allowance for drag on a turning vehicle;
* vertical: f_z is outside the range of the propellers, from zero to their maximum (see `free_flight`). A failed motor,
  free fall, a dropped payload and every manoeuvre stay inside;
* the body rates jump, and stay, or the velocity jumps and the accelerometer does not show it (see `jumps`).

A velocity jump follows a contact of which the samples hold a part at most: a force below its limit adds to it, by
squares.

A person's hand and a soft strike on a hovering vehicle differ in how the force begins. An arm takes 80 ms and more to
push; a hand that grips stops the small speed of a hover. An obstacle strikes with its own speed, and its force is there
from one sample to the next. So a weak force on a hovering vehicle is observed for a moment, and is a strike as soon as
it jumps. `classify` names the kind.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from companion.messages import AttitudeTarget, ImuSample, LocalPosition, MessageId, Odometry, Sample, Vector3
from companion.motion.config import CURRENT_US, GRAVITY_M_S2, LONGEST_DELAY_US, LONGEST_GAP_US, SHOWN_US
from companion.motion.rotation import ned_to_body
from companion.motion.vector import ZERO, along, limited, minus, plus, towards, unit
from companion.reflex import config as reflex
from companion.reflex.detection.classify import classified, hovers
from companion.reflex.detection.detector import (
    ON_THE_GROUND,
    DetectorState,
    Evidence,
    Impact,
    ImpactKind,
    Innovation,
    Motion,
    Phase,
    Situation,
)
from companion.reflex.detection.free_flight import ForceNoise, Lever
from companion.reflex.detection.jumps import RateJump, VelocityJump


@dataclass(slots=True)
class FusedState(DetectorState):
    """Changed in place by `FusedDetector.step`; methods only read it. Times: vehicle's boot clock; forces: body FRD,
    m/s^2.
    """

    side: Innovation = field(default_factory=Innovation)
    vertical: Innovation = field(default_factory=Innovation)
    turn: RateJump = field(default_factory=RateJump)
    velocity: Innovation = field(default_factory=Innovation)
    """Of the newest IMU sample and velocity. A velocity that cannot be compared has an infinite limit."""
    vertical_threshold_m_s2: float = 0.0  # beyond the force that propellers can make
    floor: ForceNoise = field(default_factory=ForceNoise)
    jump: VelocityJump = field(default_factory=VelocityJump)
    left_m_s: float = 0.0  # by how much the last velocity may have been wrong by an earlier hit
    velocity_ned_m_s: Vector3 | None = None
    moved_boot_us: int = 0
    hovered_boot_us: int | None = None
    """When it last hovered, and had for a while: one that only turns back is slow for a moment, too."""
    contact_began_boot_us: int = 0
    kind: ImpactKind = ImpactKind.UNKNOWN  # of the present contact, or the latest one
    observed: Impact | None = None  # the first loud sample while it is observed whether that is a hand
    last_frd_m_s2: Vector3 = ZERO  # at the centre, as the next
    before_frd_m_s2: Vector3 = ZERO  # of the sample before the last
    before_threshold_m_s2: float = 0.0  # before the last sample was learnt: it may be a hit's first
    force: tuple[float, Vector3] = (0.0, ZERO)
    """Of the newest sample, or of two together: in limits, and as the accelerometer shows it."""
    force_before: tuple[float, Vector3] = (0.0, ZERO)  # the one before

    def side_m_s2(self, x: float, y: float, config: reflex.FusedConfig, lever: Lever) -> float:
        """Horizontal force, m/s^2, less what a turn may make of it: along that, an unknown height of the accelerometer
        adds to the noise.
        """
        (a, b), limit = lever.error_frd_m_s2, self.threshold_m_s2 + lever.unseen_m_s2
        if (error_m_s2 := math.hypot(a, b)) == 0.0:
            return math.hypot(x, y)
        turned_m_s2 = math.hypot(self.threshold_m_s2, config.noise_factor * error_m_s2) + lever.unseen_m_s2
        return math.hypot(x * b - y * a, (x * a + y * b) * limit / turned_m_s2) / error_m_s2

    def side_force(self, config: reflex.FusedConfig, lever: Lever) -> tuple[float, float, bool]:
        """Horizontal force and its limit, m/s^2; whether it is that of two samples together.

        Of one sample, or of two on a vehicle that vibrates until a contact has begun: what is nearer to a hit. Within a
        contact each sample speaks for itself: the one after a forged sample does not confirm it.
        """
        f, mean = lever.force_frd_m_s2, self.floor.mean_frd_m_s2[:2]
        limit = self.threshold_m_s2 + lever.unseen_m_s2
        alone = self.side_m_s2(f[0] - mean[0], f[1] - mean[1], config, lever)
        if self.phase is not Phase.ARMED:
            return alone, limit, False
        if math.hypot(*mean) > config.side_threshold_m_s2:
            # The mean is a push, whose end is no hit.
            alone = min(alone, self.side_m_s2(f[0], f[1], config, lever))
        if self.threshold_m_s2 <= reflex.SHAKING * config.side_threshold_m_s2:
            return alone, limit, False
        together, of_two = self._together_m_s2(f, config, lever), self.before_threshold_m_s2 / self.threshold_m_s2
        # A clear one is no mean with the weak one before it.
        if alone < reflex.CLEAR * limit and together / of_two > alone / reflex.CLEAR:
            return together, of_two * limit, True
        return alone, reflex.CLEAR * limit, False

    def _together_m_s2(self, force_frd_m_s2: Vector3, config: reflex.FusedConfig, lever: Lever) -> float:
        """Horizontal force of a sample and the one before it, as of one: their sum over the root of two, by which the
        noise of a sum grows. Vibration alternates, a contact does not.

        Compared with zero, too: a slow swing that the mean has not followed is none.
        """
        (m_x, m_y, _), (x, y, _) = self.floor.mean_frd_m_s2, plus(force_frd_m_s2, 1.0, self.last_frd_m_s2)
        beside = self.side_m_s2(x - 2.0 * m_x, y - 2.0 * m_y, config, lever)
        return math.sqrt(0.5) * min(beside, self.side_m_s2(x, y, config, lever))

    def both(self, ratio: float, step_frd_m_s: Vector3) -> Vector3 | None:
        """The direction of a velocity jump and the weak force before it, body FRD: each is as clear as it is large
        beside its limit. None for opposite ones: a bias of the accelerometer is a force, and makes a jump the other
        way.
        """
        weak, felt = max(self.force, self.force_before)
        felt, steps = unit(minus(felt, self.free_frd_m_s2)), unit(step_frd_m_s)
        return unit(plus(plus(ZERO, ratio, steps), weak, felt)) if along(felt, steps) >= 0.0 else None

    @property
    def free_frd_m_s2(self) -> Vector3:
        """What a sample shows in free flight."""
        x, y, z = self.floor.mean_frd_m_s2
        return (x, y, self.thrust.expected_m_s2(self.last_sample_boot_us, z))

    def may_be_hand(self, time_us: int) -> bool:
        """Whether the vehicle hovers, or just did: pushed by a hand with 2 m/s^2 it soon moves, but not fast."""
        is_slow = math.hypot(*self.velocity_ned_m_s or ZERO) < reflex.SLOW_M_S
        return is_slow and self.hovered_boot_us is not None and time_us - self.hovered_boot_us < CURRENT_US


class FusedDetector:
    """See the module's text."""

    name = "fused"
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "a force from below counts only beyond 5 g",
        MessageId.ODOMETRY: "resets of the estimator look like hits, so a velocity jump must be twice as large",
    }

    def __init__(self, config: reflex.FusedConfig, averaging_interval_us: int) -> None:
        self._config = config
        self._averaging_us = averaging_interval_us

    def initial(self) -> FusedState:
        side, vertical = self._config.side_threshold_m_s2, self._config.vertical_threshold_m_s2
        return FusedState(threshold_m_s2=side, vertical_threshold_m_s2=vertical)

    def step(self, state: FusedState, sample: Sample, situation: Situation, motion: Motion) -> Impact | None:
        if type(sample) is ImuSample:
            before_us, now_us = state.last_sample_boot_us, sample.time_boot_us
            state.turn.imu(before_us, now_us, sample.angular_velocity_frd_rad_s, self._config)
            impact = self._imu(state, sample, situation, motion)
            state.before_frd_m_s2, state.last_frd_m_s2 = state.last_frd_m_s2, motion.lever.force_frd_m_s2
            return impact
        if isinstance(sample, (LocalPosition, Odometry)):
            return self._velocity(state, sample, situation, motion)
        if isinstance(sample, AttitudeTarget):
            state.thrust.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        return None

    # --- force ------------------------------------------------------------------------------------------------

    def _imu(self, s: FusedState, sample: ImuSample, situation: Situation, motion: Motion) -> Impact | None:
        config, now_us, f = self._config, sample.time_boot_us, motion.lever.force_frd_m_s2
        off = situation.off_reason
        if off is None and situation.is_on_ground:
            off = ON_THE_GROUND  # feet that stand on it shake and push
        free_until_us = before_us = s.last_sample_boot_us
        earlier_us, s.last_sample_boot_us = before_us - s.turn.over_us, now_us
        # What a turn that began with the last sample made of it shows in the rates now.
        s.force_before = (s.force[0] / (1.0 + motion.lever.unseen_m_s2 / s.side.limit), s.force[1])
        s.side.value, s.side.limit, is_of_two = s.side_force(config, motion.lever)
        s.vertical.value, s.vertical.limit = max(f[2], -f[2] - s.thrust.most_m_s2), s.vertical_threshold_m_s2
        sideways, upright = s.side.value / s.side.limit, s.vertical.value / s.vertical.limit
        is_of_two = is_of_two and sideways >= upright
        if is_of_two:
            free_until_us = earlier_us
        ratio = max(sideways, upright)
        s.force = (ratio, towards(f, s.last_frd_m_s2, 0.5) if is_of_two else f)
        if off is not None:
            s.phase, s.off_reason = Phase.OFF, off
        elif s.phase is Phase.OFF:
            s.phase = Phase.QUIET
            s.last_loud_boot_us = now_us + (reflex.SETTLED_US if s.off_reason == ON_THE_GROUND else 0)
        if ratio < 1.0:
            s.observed = None
            self._learn(s, motion.lever, before_us)
            is_quiet = s.floor.known_s >= reflex.LEARNT_S and now_us - s.last_loud_boot_us >= 1e6 * config.rearm_quiet_s
            if is_quiet and s.phase is not Phase.OFF:
                s.phase = Phase.ARMED
            return self._turned(s, earlier_us, situation, motion) if s.turn.value > s.turn.limit else None
        motion.lever.forget()
        lasts_s = 1e-6 * (now_us - s.contact_began_boot_us)
        force = minus(s.force[1], s.free_frd_m_s2)
        is_shaking = s.phase is Phase.CONTACT and lasts_s > config.longest_contact_s
        is_learnt = math.dist(f, s.floor.mean_frd_m_s2) < s.threshold_m_s2
        if s.phase in (Phase.OFF, Phase.QUIET) or is_shaking:
            self._learn(s, motion.lever, before_us)  # a shaking that stays
        free_until_us = min(now_us - self._averaging_us, free_until_us)
        # Noise hardly brings the sample before so near to its limit, too.
        is_twice = s.force_before[0] > 1.0 / reflex.CLEAR
        impact = Impact(now_us, free_until_us, force, is_shown_twice=is_twice, free_frd_m_s2=s.free_frd_m_s2)
        if s.phase is Phase.OFF:
            # A force that stays is no crash: the vehicle lies on its back, or its sensor is upside down.
            return None if is_learnt else self._unwatched(s, situation, motion, impact)
        return self._loud(s, situation, motion, impact, f)

    def _turned(self, s: FusedState, free_until_us: int, situation: Situation, motion: Motion) -> Impact | None:
        """What turned a vehicle that did not hover pushed it back: where to, only its velocity before says."""
        now_us = s.last_sample_boot_us
        before = motion.history.before(free_until_us + 1) if math.isfinite(motion.left_m_s) else None
        is_again = free_until_us - s.last_loud_boot_us < 1e6 * self._config.rearm_quiet_s
        if s.phase is not Phase.ARMED or is_again or before is None or s.may_be_hand(now_us):
            return None
        push = plus(ZERO, -1e6 / (now_us - free_until_us), before.velocity_ned_m_s)
        impact = Impact(
            now_us,
            free_until_us,
            ned_to_body(motion.strapdown.valid_wxyz, push),
            evidence=Evidence.RATE_JUMP,
            is_shown_twice=True,
            free_frd_m_s2=s.free_frd_m_s2,
        )
        return self._fire(s, situation, motion, impact)

    def _unwatched(self, s: FusedState, situation: Situation, motion: Motion, impact: Impact) -> Impact | None:
        """A crash is reported where no hit is looked for, too: in a take-off, in a landing, under strong vibration."""
        since_us = impact.sample_time_boot_us - s.contact_began_boot_us
        is_known = s.kind is ImpactKind.CRASH and since_us <= 1e6 * self._config.longest_contact_s
        if is_known or not situation.may_crash:
            return None
        impact = classified(impact, s.velocity_ned_m_s, situation, motion)
        return self._begun(s, impact) if impact.kind is ImpactKind.CRASH else None

    def _learn(self, s: FusedState, lever: Lever, before_us: int) -> None:
        elapsed_us, f = s.last_sample_boot_us - before_us, lever.force_frd_m_s2
        # A sample after a gap or a reboot has the weight of the longest interval.
        elapsed_s = 1e-6 * (elapsed_us if 0 < elapsed_us < LONGEST_GAP_US else LONGEST_GAP_US)
        lifts_m_s2 = -s.thrust.expected_m_s2(s.last_sample_boot_us, s.floor.mean_frd_m_s2[2])
        s.floor.learn(f, elapsed_s, lifts_m_s2 / GRAVITY_M_S2 if lifts_m_s2 > GRAVITY_M_S2 else 1.0)
        config, s.before_threshold_m_s2 = self._config, s.threshold_m_s2
        s.threshold_m_s2 = max(config.side_threshold_m_s2, config.noise_factor * s.floor.side_m_s2)
        s.vertical_threshold_m_s2 = max(config.vertical_threshold_m_s2, config.noise_factor * s.floor.vertical_m_s2)
        if s.phase in (Phase.QUIET, Phase.ARMED):
            s.thrust.learn(s.last_sample_boot_us, -f[2], elapsed_s)
            if s.turn.turns_rad_s2 > reflex.TURNS_PER_S2 or lever.spins_per_s2 > reflex.TURNS_PER_S2:
                # A contact may push by less than the limit, too.
                lever.learn((s.side.limit / config.noise_factor) ** 2, elapsed_s)

    def _loud(self, s: FusedState, situation: Situation, motion: Motion, impact: Impact, f: Vector3) -> Impact | None:
        now_us, size = impact.sample_time_boot_us, impact.size_m_s2
        if s.phase is not Phase.ARMED:
            s.last_loud_boot_us = max(now_us, s.last_loud_boot_us)
            if s.phase is Phase.CONTACT:
                impact = classified(impact, s.velocity_ned_m_s, situation, motion)
                # A touch that tips the vehicle over becomes a crash.
                if impact.kind is ImpactKind.CRASH and s.kind is not ImpactKind.CRASH:
                    return self._fire(s, situation, motion, impact)
                s.peak_specific_force_m_s2 = max(s.peak_specific_force_m_s2, size)
            return None
        first = s.observed = s.observed or impact
        impact = replace(impact, contact_free_until_boot_us=first.contact_free_until_boot_us)
        # A hand's force changes by less, over one sample or two.
        jumped_m_s2 = max(math.dist(f, s.last_frd_m_s2), math.dist(f, s.before_frd_m_s2))
        is_weak = size < self._config.soft_m_s2 and jumped_m_s2 < reflex.JUMP * s.threshold_m_s2
        if is_weak and s.may_be_hand(now_us):
            if now_us - first.sample_time_boot_us < 1e6 * self._config.soft_wait_s:
                return None
            impact = replace(impact, kind=ImpactKind.CONTACT)
        return self._fire(s, situation, motion, impact)

    def _fire(self, s: FusedState, situation: Situation, motion: Motion, impact: Impact) -> Impact:
        """A hit that is looked for."""
        s.phase, s.last_loud_boot_us = Phase.CONTACT, impact.sample_time_boot_us
        return self._begun(s, classified(impact, s.velocity_ned_m_s, situation, motion))

    def _begun(self, s: FusedState, impact: Impact) -> Impact:
        s.contact_began_boot_us, s.kind = impact.sample_time_boot_us, impact.kind
        s.peak_specific_force_m_s2 = impact.size_m_s2
        return impact

    # --- velocity ---------------------------------------------------------------------------------------------

    def _velocity(
        self, s: FusedState, sample: LocalPosition | Odometry, situation: Situation, motion: Motion
    ) -> Impact | None:
        time_us, jump, config, strapdown = sample.time_boot_us, s.jump, self._config, motion.strapdown
        s.velocity_ned_m_s = v = sample.velocity_ned_m_s
        if not hovers(v):
            s.moved_boot_us = time_us
        elif time_us - s.moved_boot_us >= CURRENT_US:
            s.hovered_boot_us = time_us
        # A filter makes a pulse of a contact, of which samples hold a part. A jump beside them is the estimator's own.
        if not strapdown.has_new_fix or motion.hides_clipping:
            return None
        s.velocity.value, s.velocity.limit = 0.0, math.inf
        # As it was known before this velocity, which the next hit has changed, too.
        left_m_s, s.left_m_s = s.left_m_s, motion.left_m_s
        if time_us - s.last_loud_boot_us < SHOWN_US:
            jump.since_us = time_us
            return None
        step = jump.step_m_s(strapdown.fixes)
        if step is None:
            return None
        # Vibration between the samples, of whose newest interval an averaging window covers a part.
        shaking_m_s2 = (s.threshold_m_s2 - config.side_threshold_m_s2) / config.noise_factor
        unseen_m_s = reflex.SHAKEN_S * shaking_m_s2 * max(0.0, 1.0 - self._averaging_us / max(s.turn.over_us, 1))
        # ODOMETRY alone counts the estimator's resets. An estimator that corrects a hit may jump.
        caution = 1.0 if type(sample) is Odometry and math.isfinite(motion.left_m_s) else 2.0
        least = math.hypot(jump.least_m_s(config, caution), config.noise_factor * jump.error_m_s) + unseen_m_s
        size = math.hypot(*step)
        corrected_m_s = 0.0 if motion.after is None else motion.after.correction_m_s(jump.compared_us, left_m_s)
        s.velocity.value, s.velocity.limit = size, least + corrected_m_s
        ratio = s.velocity.value / s.velocity.limit
        felt = max(s.force[0], s.force_before[0])
        is_weak = ratio <= 1.0 < math.hypot(ratio, felt) and not s.may_be_hand(time_us)
        both = s.both(ratio, ned_to_body(strapdown.valid_wxyz, step)) if is_weak else None
        is_jump = ratio > 1.0 or both is not None
        if s.phase is not Phase.ARMED or not is_jump:
            # What is told as a hit is no noise.
            if is_jump or motion.is_valid:
                jump.learn(limited(step, least))
            return None
        jump.since_us = time_us
        now_us = max(time_us, s.last_sample_boot_us)
        free_until_us = strapdown.fixes[-2].time_boot_us - LONGEST_DELAY_US
        over_s = max(now_us - free_until_us, 1) * 1e-6
        force = plus(ZERO, size / over_s, both or unit(ned_to_body(strapdown.valid_wxyz, step)))
        s.velocity_ned_m_s = minus(v, step)
        impact = Impact(now_us, free_until_us, force, evidence=Evidence.VELOCITY_JUMP, is_shown_twice=is_weak)
        return self._fire(s, situation, motion, impact)
