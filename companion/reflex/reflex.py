"""The door of the reflex: samples in; what was touched, and the way to rest from it, out.

A step of a flight calls `step` with its samples, `begin` for a collision that it recovers from, `newest.take` with
each position until the vehicle rests, and `follow` at the end. Pure: the same calls give the same bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import NamedTuple

from companion.messages import AttitudeTarget, ImuSample, LandedState, LocalPosition, Sample, Vector3
from companion.motion.config import KEPT_US, LONGEST_GAP_US, SettledConfig
from companion.motion.rotation import body_to_ned, tilt_rad
from companion.motion.vector import ZERO, plus
from companion.reflex import config as numbers
from companion.reflex.detection.confirmation import hypothesis_of
from companion.reflex.detection.crash import CrashWatch
from companion.reflex.detection.detector import ImpactKind, Situation
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.detection.monitor import CollisionMonitor, CollisionMonitorConfig, Notice, advance, start_monitor
from companion.reflex.detection.sustained_force import SustainedForceMonitor
from companion.reflex.recovery.attitude_law import Lean, wanted
from companion.reflex.recovery.collision import Collision, Room
from companion.reflex.recovery.laws import RECOVERY_LAWS, Law


class Reaction(NamedTuple):
    """What the samples of one step have shown. `collisions` are to be recovered from."""

    collisions: Sequence[ImpactEstimate]
    has_touched_down: bool
    notices: Sequence[Notice]


NOTHING_SHOWN = Reaction((), False, ())


class LeftWrong(NamedTuple):
    """What a vehicle's own estimate has wrong after a hit, and what pushes it; local NED. `share`: of them, by now."""

    share: float
    position_m: Vector3
    velocity_m_s: Vector3
    pushed_m_s2: Vector3


@dataclass(slots=True)
class Reflex:
    """Changed only by its methods."""

    config: CollisionMonitorConfig
    law_config: numbers.RecoveryConfig
    settled: SettledConfig
    monitor: CollisionMonitor = field(init=False)
    hits: list[Collision] = field(default_factory=list)
    newest: Collision | None = None  # of them, since the vehicle started
    loss_s: float | None = None  # for so long the vehicle flies its last setpoint on; infinite: it takes no thrust
    keeps_trim: bool = False  # see interface.Autopilot
    sustained_force: SustainedForceMonitor = field(default_factory=SustainedForceMonitor)
    crash: CrashWatch = field(default_factory=CrashWatch)
    held: ImpactEstimate | None = None  # the latest impact that no detector has shown

    def __post_init__(self) -> None:
        self._start(0)

    def _start(self, now_us: int) -> None:
        self.monitor, self.held = start_monitor(self.config, now_us), None
        self.monitor.estimator.recovery = self.law_config

    # --- what was touched

    def restart(self, now_us: int) -> None:
        """Of a vehicle that has restarted, perhaps by a hit, nothing that was measured before is valid."""
        hides_clipping = self.monitor.estimator.hides_clipping
        self._start(now_us)
        self.monitor.estimator.hides_clipping = hides_clipping
        self.loss_s = None
        if self.newest is not None:
            self.newest.is_over, self.newest = True, None

    def step(self, samples: Sequence[Sample], situation: Situation, now_us: int) -> Reaction:
        """Take the samples received since the last step, in order; call it without any, too."""
        impacts, notices = advance(self.monitor, samples, situation, now_us)
        # A crash is told where no hit is looked for, too.
        found = [each for each in impacts if each.impact.is_collision and not situation.off_reason] if impacts else []
        held = None if found else self._held(samples, situation)
        if not situation.is_wreck:
            notices += filter(None, map(self._contact_notice, impacts))
        if held is not None:
            found = [held]
            notices.append(_held_notice(held))
            self.held = held
        if not impacts and not notices:
            return NOTHING_SHOWN
        return Reaction(found, any(each.impact.is_ground for each in impacts), notices)

    def _contact_notice(self, estimate: ImpactEstimate) -> Notice | None:
        """What is no collision, and a crash; a collision is told with its recovery."""
        kind, force_m_s2 = estimate.impact.kind, estimate.peak_specific_force_m_s2
        if not estimate.impact.is_collision:
            text = f"{kind.value}: {force_m_s2:.1f} m/s^2, no collision"
            return Notice("contact", text, {"touched": kind.value, "specific_force_m_s2": force_m_s2})
        if kind is not ImpactKind.CRASH:
            return None
        tilt_deg = math.degrees(tilt_rad(self.monitor.estimator.strapdown.valid_wxyz))
        down_m_s = estimate.velocity_ned_m_s[2]
        text = f"crash: {force_m_s2:.0f} m/s^2, sinking at {down_m_s:.1f} m/s, tilted by {tilt_deg:.0f} degrees"
        return Notice("crash", text, {"specific_force_m_s2": force_m_s2, "down_m_s": down_m_s, "tilt_deg": tilt_deg})

    def _held(self, samples: Sequence[Sample], situation: Situation) -> ImpactEstimate | None:
        """A sustained external force that no detector shows: of a vehicle that flies to a position, or that tips."""
        force, is_watched = self.sustained_force, situation.off_reason is None and not situation.descent_commanded
        if not situation.has_position:
            is_watched = False
            force.forget()  # half a second without a position is no tilt that lasted half a second
        flown_to = situation.setpoint_position_ned_m if is_watched else None
        hit = self.newest
        is_free = hit is None or hit.is_over
        # What has just been hit may have turned it, until it has come to rest.
        may_tip = is_watched and (hit is None or hit.is_over or hit.has_rested)
        for sample in samples:
            if type(sample) is ImuSample:
                force.add_imu(sample.specific_force_frd_m_s2)
            elif type(sample) is AttitudeTarget:
                force.set_attitude(sample)
            elif isinstance(sample, LocalPosition) and self._is_attitude_heard:
                late_us = force.time_us - sample.time_boot_us
                if late_us >= KEPT_US:
                    force.forget()
                elif late_us >= 0:
                    continue
                held = force.step(sample, self.monitor.estimator.strapdown, flown_to, is_free, may_tip)
                if held is not None:
                    return held
        return None

    # --- the way to rest

    def begin(self, estimate: ImpactEstimate, room: Room, now_us: int) -> Collision:
        """Record a collision, and begin to recover from it: the motion just before it, and the goal by that."""
        impact, earlier, source = estimate.impact, self.in_one_recovery(), self.monitor.estimator
        # What holds the vehicle no detector has seen.
        estimator = estimate.after or source.motion_after(estimate)
        source.followed, estimator.is_answered = [*source.answered[-1:], estimator], True
        estimator.note_wind(self.sustained_force.hover_wind_m_s2)
        surfaces = [each.surfaces[0] for each in earlier]
        shown = self.config.detector, impact.size_m_s2, source, estimator
        how = self.law, self.law_config, self.settled
        self.newest = Collision(now_us, *shown, *how, room, surfaces, self.keeps_trim)
        # Behind a filter that hides clipping the vehicle's velocity may show nothing of a true hit.
        if not earlier and self._is_attitude_heard and not source.hides_clipping:
            force_ned = body_to_ned(source.strapdown.attitude_wxyz, impact.specific_force_frd_m_s2)
            averaging_s = self.config.estimate.imu_averaging_interval_s
            self.newest.hypothesis = hypothesis_of(estimate, force_ned, averaging_s, estimator.left_before_m_s)
        self.hits.append(self.newest)
        return self.newest

    def take_back(self) -> None:
        """Forget the newest collision. What was none hides nothing of the vehicle's velocity."""
        source, taken = self.monitor.estimator, self.hits.pop()
        self.newest = next((each for each in self.hits[-1:] if each.source is source), None)
        source.followed = [each for each in source.followed if each is not taken.estimator]

    def lean(self) -> tuple[Vector3, Lean]:
        """The acceleration wanted by the present recovery, local NED, and what makes attitude and thrust of it.

        What PX4 holds goes on while it turns its thrust.
        """
        hit = self.newest
        assert hit is not None and self.loss_s is not None, "only a known one lets it lean"
        belief = hit.estimator.belief(hit.source.strapdown)
        held_s = self.loss_s + numbers.NOTICED_S + numbers.LEAD_S
        acceleration = wanted(belief, hit.surfaces, hit.setpoint_ned_m[2])
        return acceleration, Lean(belief, hit.surfaces, self.monitor.state.thrust.full_m_s2, held_s)

    def follow(self, samples: Sequence[Sample], height_m: float | None, landed: LandedState) -> None:
        """Take the samples of the step for what confirms the newest hit, and for what shows a crash."""
        if self.newest is not None:
            self.newest.follow(self.monitor.state)
        self.crash.update(samples, height_m, landed)

    def left_wrong(self, time_boot_us: int) -> LeftWrong | None:
        """Left by the newest hit, and by flying by attitude, in which the vehicle's integrators forget what pushes."""
        newest, share = self.newest, self._left_share(time_boot_us)
        if newest is None or share <= 0.0 or not newest.law.leans:
            return None
        estimator = newest.estimator
        pushed = ZERO if self.keeps_trim else plus(estimator.wind_m_s2, 1.0, estimator.tilted_m_s2)
        return LeftWrong(share, estimator.position_error_m, estimator.velocity_error_m_s, pushed)

    def _left_share(self, time_boot_us: int) -> float:
        """They fade out, as PX4 puts all of it right by itself, but for what a receiver shows."""
        newest = self.newest
        if newest is None or not newest.estimator.has_converged:
            return 0.0
        left_us = newest.estimator.hit_boot_us + numbers.FADED_US - time_boot_us
        share = 2.0 * left_us / numbers.FADED_US
        return 1.0 if newest.estimator.is_measured_apart else min(max(share, 0.0), 1.0)

    def place_ned_m(self, reported: LocalPosition) -> Vector3:
        """Where the vehicle is: by the belief in a recovery, as far as the IMU carries it on; then as reported without
        what is left wrong."""
        newest = self.newest
        if newest is None:
            return reported.position_ned_m
        if not newest.is_over and reported.time_boot_us - self.sample_boot_us <= LONGEST_GAP_US:
            return newest.estimator.motion.position_ned_m
        share = self._left_share(reported.time_boot_us)
        return plus(reported.position_ned_m, -share, newest.estimator.position_error_m)

    # --- by which law

    @property
    def law(self) -> Law:
        """The one that is asked for, or what is flown in its place."""
        return RECOVERY_LAWS["paper" if self.why_by_position is not None else self.law_config.law]

    @property
    def why_by_position(self) -> str | None:
        """Why a vehicle that would be flown by attitude cannot be, for people; else None."""
        if not RECOVERY_LAWS[self.law_config.law].leans:
            return None
        if self.loss_s is None or self.loss_s > numbers.MOST_HELD_S:
            if self.loss_s == math.inf:
                return "the autopilot takes no thrust with an attitude"
            held = "for an unknown time" if self.loss_s is None else f"for {self.loss_s:g} s"
            return f"without a companion an attitude is held {held}; {numbers.MOST_HELD_S:g} s is safe"
        if self.monitor.state.thrust.known_s < numbers.THRUST_LEARNT_S:
            return "the thrust is not known yet"
        return None if self._is_attitude_heard else "no attitude is heard"

    # --- what is known

    @property
    def latest(self) -> ImpactEstimate | None:
        """The latest impact, by a detector or by what holds the vehicle."""
        known = filter(None, (self.monitor.estimator.estimate, self.held))
        return max(known, key=lambda each: each.impact.sample_time_boot_us, default=None)

    def in_one_recovery(self) -> list[Collision]:
        """The last hits, the newest first, without a recovery in between."""
        return list(takewhile(lambda record: not record.is_over, reversed(self.hits)))

    def is_without_imu(self, now_us: int) -> bool:
        """Whether no sample has come for longer than the belief is carried on without one."""
        arrivals_us = self.monitor.stream_health.arrivals_us
        return bool(arrivals_us) and now_us - arrivals_us[-1] > LONGEST_GAP_US

    @property
    def sample_boot_us(self) -> int:
        """Of the newest IMU sample, by the vehicle's clock."""
        return self.monitor.estimator.strapdown.time_boot_us

    @property
    def _is_attitude_heard(self) -> bool:
        return self.monitor.gate.latest is not None


def _held_notice(held: ImpactEstimate) -> Notice:
    normal, force_m_s2, lasted_s = held.normal.direction_ned, held.peak_specific_force_m_s2, held.time_error_us * 1e-6
    side = "horizontal" if normal[2] == 0.0 else "downward" if normal[2] > 0.0 else "upward"
    text = f"something is in the way: {side} external force of {force_m_s2:.1f} m/s^2 for {lasted_s:.1f} s"
    return Notice("in_the_way", text, {"normal_ned": normal, "push_m_s2": force_m_s2, "lasted_s": lasted_s})
