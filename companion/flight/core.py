"""The pure core of a flight and of a guard: (core, samples, now) -> messages to send and events. No bytes, no clock.

A core is changed only by `advance`: the same samples at the same times give the same outputs, so that a flight can be
replayed.
"""

import math
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar, Generic

from companion.flight.after_hit import note_motors
from companion.flight.context import FlightContext, FlightT, Handler, Inputs, Target, Transition
from companion.flight.envelope import Surroundings, bounded
from companion.flight.handlers.ending import Released
from companion.flight.obstacle_map import known_surfaces
from companion.flight.operator import Texts, status_text, values
from companion.flight.vehicle_update import note_height, update_vehicle
from companion.link.commands import CommandClient
from companion.messages import CommandAck, LocalPosition, MotorOutputs, OnboardHeartbeat, Outgoing, Sample
from companion.motion.resets import PLACES, Resets
from companion.motion.vector import ZERO, plus
from companion.reflex.config import AWAY_M_S2, HELD_S, LEAD_S, NOTICED_S
from companion.reflex.detection.detector import Situation
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.recovery.attitude_law import braked
from companion.reflex.recovery.collision import CollisionReport
from companion.report import Event

# MAVLink's heartbeat microservice: once a second.
HEARTBEAT_INTERVAL_US = 1_000_000
# All timeouts are noticed within this, when nothing arrives.
POLL_INTERVAL_US = 50_000


class Core(ABC, Generic[FlightT]):
    """The state between two steps, and the part of a step that a flight and a guard share."""

    program: ClassVar[str]
    table: ClassVar[Mapping[Any, Mapping[Any, Any]]]
    handlers: ClassVar[Mapping[Any, Callable[[Any, int], Handler[Any]]]]
    """Of all states that need no more to begin than the time."""
    stopping: ClassVar[Enum]  # the trigger that gives the vehicle away; a state without it has given it away already
    failed: ClassVar[Enum]  # the state after a fault in which even giving away fails
    state: Any

    def __init__(self, flight: FlightT) -> None:
        self.flight, self.reflex = flight, flight.reflex
        self._heartbeat_due_us = self._setpoint_due_us = self._values_due_us = 0
        self._sample_boot_us = 0
        self._sent: Target | None = None  # as last sent, in the vehicle's view
        self._leans: bool | None = None  # by attitude, or by position; None while another may send setpoints
        self._law = CommandClient()  # what the vehicle is told of it, until it has answered
        self._untold: list[Event] = []  # of the last step, to the operator
        self.stop_reason: str | None = None
        self.limiter, self.resets, self._texts = Limiter(), Resets(), Texts()
        self.begin(0)

    @property
    def holds(self) -> bool:
        """Whether the vehicle flies, or is about to fly, by this program's setpoints; of a flight all are its own."""
        return True

    @property
    def _setpoint_hz(self) -> float:
        return self.flight.mission.companion.flight.setpoint_hz

    def begin(self, now_us: int) -> None:
        """Before the first step: times count from now on."""
        self.started_at_us = self.now_us = now_us
        self.handler = self.handlers[self.state](self.flight, now_us)

    def advance(self, samples: Sequence[Sample], now_us: int) -> tuple[list[Outgoing], list[Event]]:
        """One step: update from the samples, detect hits, run the state machine, send what is due."""
        self.now_us, known = now_us, self.flight.vehicle.identity
        moved = self._react(samples, now_us)
        if known is None and self.flight.vehicle.identity is not None:
            # A vehicle that is met hears of it first: a companion may have died before.
            self._change_law(self._leans, now_us, is_new=True)
        elif self._law.pending is not None:
            self._repeat_law(samples, now_us)
        self._stream_setpoint(moved, now_us)
        flight = self.flight
        if now_us >= self._heartbeat_due_us and not self.handler.finished:
            self._heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
            flight.outbox.append(OnboardHeartbeat(self.handler.is_active))
        if self._untold or self.handler.finished or self._texts.waiting or now_us >= self._values_due_us:
            try:
                self._inform(now_us)
            except Exception as error:
                self.fault(error, now_us)
        sent, told = flight.outbox, flight.events
        flight.outbox, flight.events = [], []
        self._untold = [] if self.handler.finished else told
        return sent, told

    def fault(self, error: Exception, now_us: int) -> None:
        """Handle a fault after the state machine. The first hands the vehicle over; later ones change nothing."""
        if not self.flight.fault:
            self._fail(error, now_us)

    def _fail(self, error: Exception, now_us: int) -> None:
        """This program is at fault: give the vehicle away while that can still be done, and say what happened."""
        flight = self.flight
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"fault of the {self.program}, please report it: {type(error).__name__} in {place.name}: {error}"
        flight.report(now_us, "fault", text, traceback="".join(traceback.format_exception(error)))
        if flight.fault or self.stopping not in self.table[self.state]:
            self._release(text)
        flight.fault = text
        try:
            self._take(Transition(self.stopping, text), now_us)
        except Exception as second:
            trace = "".join(traceback.format_exception(second))
            flight.report(now_us, "fault", f"and again: {second}", traceback=trace)
            self._release(text)

    def _react(self, samples: Sequence[Sample], now_us: int) -> bool:
        """Detection and the state machine; whether that moved on. Any exception hands the vehicle over and is reported.

        Heartbeats, setpoints and the log go on meanwhile. After a fault hits are not detected any more.
        """
        flight, before = self.flight, self.handler
        kinds = set(map(type, samples))
        try:
            if not PLACES.isdisjoint(kinds):
                samples = self._in_one_frame(samples, now_us)
            refusal = self._hear(samples, now_us)
            note_height(flight)
            impacts = () if flight.fault else self._notice(samples, now_us)
            acks = [each for each in samples if isinstance(each, CommandAck)] if CommandAck in kinds else []
            history = flight.vehicle.history
            positions = [each for each in samples if isinstance(each, LocalPosition) and history.remembers(each)]
            self._act(samples, Inputs(acks, positions, impacts, self.stop_reason, refusal), now_us)
            # The height counts where there is a new one.
            if not flight.fault:
                self.reflex.follow(samples, flight.height_m if positions else None, flight.vehicle.landed)
            if not flight.fault and (not flight.vehicle.armed or MotorOutputs in kinds):
                note_motors(flight, samples, now_us)
        except Exception as error:
            self._fail(error, now_us)
        return self.handler is not before

    def _in_one_frame(self, samples: Sequence[Sample], now_us: int) -> Sequence[Sample]:
        """The samples in a local frame that does not jump when the estimator resets its position.

        One that is still wrong from a hit only puts that right.
        """
        if self.flight.vehicle.armed is False and self.resets.has_shifted:
            # It may restart, and count its resets from zero.
            self.resets = Resets()
        before, is_valid = self.resets.shift_ned_m, self.reflex.monitor.estimator.is_valid
        most_m = self.flight.mission.limits.max_step_m if is_valid else 0.0
        samples = [self.resets.follow(sample, most_m) for sample in samples]
        if self.resets.shift_ned_m != before:
            jump_m = math.dist(self.resets.shift_ned_m, before)
            text = f"the vehicle's position was reset by {jump_m:.2f} m: setpoints and obstacles go along"
            shift_ned_m = self.resets.shift_ned_m
            self.flight.report(now_us, "estimate", text, jump_m=round(jump_m, 3), shift_ned_m=shift_ned_m)
        return samples

    def _hear(self, samples: Sequence[Sample], now_us: int) -> str | None:
        """Update what is known of the vehicle; why it is refused, or None."""
        return update_vehicle(self.flight, samples, now_us)

    def _notice(self, samples: Sequence[Sample], now_us: int) -> Sequence[ImpactEstimate]:
        """The collisions that the samples show; what else they show is reported."""
        flight, reaction = self.flight, self.reflex.step(samples, self.situation(), now_us)
        is_blind = self.reflex.monitor.no_data_reason is not None
        if is_blind or flight.blind.since_us is not None:
            flight.blind.update(is_blind, now_us)
        for notice in reaction.notices:
            flight.report(now_us, notice.kind, notice.text, **notice.data)
        if reaction.has_touched_down:
            flight.note_touchdown()
        return reaction.collisions

    @abstractmethod
    def _act(self, samples: Sequence[Sample], inputs: Inputs, now_us: int) -> None:
        """Take all moves that are due."""

    @abstractmethod
    def _enter(self, previous: Any, transition: Transition, now_us: int) -> Handler[Any]:
        """What is done in the present state, which was entered by that transition."""

    def _release(self, text: str) -> None:
        """Even giving away fails: silence lets the vehicle's own failsafe act."""
        flight = self.flight
        self.handler = Released(flight, self.now_us)
        if flight.outcome is None:
            self.state, flight.outcome, flight.reason = self.failed, "failed", text

    def _take(self, transition: Transition, now_us: int) -> bool:
        """Whether it moves on. A trigger counts by its name: a guard takes a flight's, too."""
        ways = {trigger.name: state for trigger, state in self.table[self.state].items()}
        if transition.trigger.name not in ways:
            return False
        previous, self.state = self.state, ways[transition.trigger.name]
        self.handler = self._enter(previous, transition, now_us)
        return True

    def _take_all(self, transition: Transition | None, now_us: int) -> None:
        """That one and all that follow from it in this step."""
        while transition is not None and self._take(transition, now_us):
            # The answers and positions of this step belong to the state that asked for them.
            transition = self.handler.step(self.flight, Inputs(), now_us)

    @abstractmethod
    def situation(self) -> Situation:
        """The detector's situation."""

    def _stream_setpoint(self, moved: bool, now_us: int) -> None:
        """Send the setpoint: at its rate, as the state changes, an attitude for each IMU sample. No other code does."""
        flight, limiter, target = self.flight, self.limiter, self.flight.target
        leans = target is not None and target.lean is not None
        is_at_once = moved or (leans and self.reflex.sample_boot_us != self._sample_boot_us)
        if not is_at_once and now_us < self._setpoint_due_us:
            return
        sample_us = self._sample_boot_us = self.reflex.sample_boot_us
        interval_us, holds = round(1e6 / self._setpoint_hz), self.holds
        if not holds:
            limiter.last = None
            self._change_law(None, now_us)
        due_us = self._setpoint_due_us + interval_us
        self._setpoint_due_us = now_us + interval_us if is_at_once or due_us <= now_us else due_us
        if not flight.vehicle.is_mode_known:
            return
        try:
            target = self.handler.target(flight, now_us)
            if target is None:
                if self._leans:
                    self._change_law(None, now_us)
                return
            # Without control the setpoint is the vehicle's own position, and is not limited.
            if holds:
                target = limiter.passed(flight, target, self.handler.has_floor, moved, now_us)
            sent = limiter.in_vehicles_view(flight, target, self.handler.has_floor, sample_us) if holds else target
            setpoint = sent.setpoint(now_us - self.started_at_us)
        except Exception as error:
            self.fault(error, now_us)
            if not holds or limiter.last is None:
                return
            target = sent = limiter.last.at_rest()
            setpoint = sent.setpoint(now_us - self.started_at_us)
        flight.outbox.append(self.resets.sent(setpoint))
        if holds:
            flight.target, self._sent = target, sent
            self._change_law(target.lean is not None, now_us)

    def _change_law(self, leans: bool | None, now_us: int, is_new: bool = False) -> None:
        """Tell the vehicle by what it is flown from now on; None: no more by this companion."""
        if leans == self._leans and not is_new:
            return
        self._leans = leans
        told = self.flight.vehicle.autopilot.changed_law(leans)
        self._law.cancel()
        if told is not None:
            self._law.begin(told)
            self._repeat_law((), now_us)

    def _repeat_law(self, samples: Sequence[Sample], now_us: int) -> None:
        """Until the vehicle has answered."""
        acks = [sample for sample in samples if isinstance(sample, CommandAck)]
        send, outcome = self._law.step(acks, False, now_us)
        if send is not None:
            self.flight.outbox.append(send)
        if outcome is not None and not outcome.succeeded:
            self.flight.report(now_us, "command", outcome.text)

    @property
    def last_words(self) -> tuple[tuple[float, Outgoing], ...]:
        """For a vehicle that would go astray if this program died now, each so many seconds later: an attitude or a
        place, again and again, and for one that does not brake by itself at last a place off what it has hit.

        By itself it flies by the velocity that it believes. Until that is right it receives a tilt and its thrust, or
        in a recovery by position its place.
        """
        flight, latest, target = self.flight, self.flight.vehicle.history.latest, self._sent
        hit, held_s = self.reflex.newest, self.reflex.loss_s
        misled_s, place_m = flight.vehicle.autopilot.misled_s, flight.vehicle.autopilot.last_place_m
        if self._leans is None or latest is None or target is None or hit is None:
            return ()
        since_s = 1e-6 * (self.reflex.sample_boot_us - hit.estimator.hit_boot_us)
        left_s, lean, now_us = misled_s - since_s, target.lean, self.now_us - self.started_at_us
        if lean is None or held_s is None:
            # By a position from now on. An autopilot that brakes by itself receives it again until it flies well.
            again = self.resets.sent(target.at_rest().setpoint(now_us))
            return self._repeated(again, held_s or HELD_S, left_s if place_m is None else 0.0)
        # It brakes by itself when it has noticed the silence; another place takes a new tilt.
        until_s = left_s - held_s - NOTICED_S if place_m is None else max(0.0, left_s) + LEAD_S
        if until_s <= 0.0:
            return ()
        north, east, _ = lean.surfaces[0].normal_ned
        brakes = braked(lean.belief, (north, east, 0.0), left_s) if place_m is None else ZERO
        asked = plus(brakes, AWAY_M_S2, (north, east, 0.0))
        tilt = self.resets.sent(lean.tilted_by(asked).setpoint(now_us, asked))
        tilts = self._repeated(tilt, held_s, until_s)
        if place_m is None:
            return tilts
        n, e, _ = plus(latest.position_ned_m, place_m, (north, east, 0.0))
        last = Target((n, e, target.position_ned_m[2]), None)
        around = Surroundings(None, flight.origin_ned_m, self.handler.has_floor)
        kept, _ = bounded(last, around, flight.mission.fence, flight.mission.limits)
        return (*tilts, (until_s, self.resets.sent(kept.setpoint(now_us))))

    def _repeated(self, word: Outgoing, held_s: float, until_s: float) -> tuple[tuple[float, Outgoing], ...]:
        """Twice as often as it has to be: a lost word ends nothing."""
        every_s = max(0.5 * held_s, 1.0 / self._setpoint_hz)
        return tuple((every_s * count, word) for count in range(max(0, math.ceil(until_s / every_s))))

    @property
    def finished(self) -> bool:
        """Ended, and the vehicle has answered the last word, or does not."""
        return self.handler.finished and self._law.pending is None

    def _inform(self, now_us: int) -> None:
        """Send the operator's texts and numbers, at their rate, once a vehicle is connected.

        Those of a step's events go with the next one: its setpoint does not wait for them.
        """
        flight, texts, is_last = self.flight, self._texts, self.handler.finished
        if flight.vehicle.identity is None:
            return
        operator, hits = flight.mission.companion.operator, len(flight.collisions)
        if operator.status_texts:
            events = [*self._untold, *(flight.events if is_last else ())]
            told = [(event.kind, status_text(event, flight.mission.name, hits)) for event in events]
            going = [(kind, text) for kind, text in told if text is not None]
            flight.outbox += texts.due(going, is_last, now_us)
        if operator.values_hz and now_us >= self._values_due_us and not is_last:
            self._values_due_us = now_us + round(1e6 / operator.values_hz)
            latest = flight.collisions[-1] if flight.collisions else None
            flight.outbox += values(self.state, self.reflex.monitor, latest, hits, now_us - self.started_at_us)

    def next_deadline_us(self) -> int:
        """When the next step is due if nothing arrives."""
        due_us = min(self._heartbeat_due_us, self.now_us + POLL_INTERVAL_US)
        return min(due_us, self._setpoint_due_us) if self._setpoint_due_us > self.now_us else due_us

    def is_due(self, now_us: int) -> bool:
        """Whether a step is due although no sample came."""
        return now_us >= self.next_deadline_us() or bool(self._untold or self.flight.events or self.flight.outbox)

    def collisions(self) -> tuple[CollisionReport, ...]:
        """All collisions so far."""
        return tuple(record.report() for record in self.flight.collisions)


# A setpoint at the edge of the envelope may cross it fifty times a second.
LEAST_BETWEEN_LIMITS_US = 1_000_000


@dataclass(slots=True)
class Limiter:
    """Limits setpoints by the envelope; remembers the last one sent and the last reason reported."""

    last: Target | None = None
    last_us: int = 0
    limited_by: str = ""
    told_us: int = 0

    def passed(self, flight: FlightContext, wanted: Target, has_floor: bool, moved: bool, now_us: int) -> Target:
        """The setpoint within the fence and the limits. `moved`: the state has changed, so a jump is allowed.

        Raises SetpointError for one that is not finite.
        """
        # Without a position setpoint there is no step to the next one.
        last = None if moved or self.last is None or self.last.lean is not None else self.last
        around = Surroundings(
            vehicle_ned_m=flight.reflex.place_ned_m(flight.latest),
            origin_ned_m=flight.origin_ned_m,
            has_floor=has_floor,
            last_ned_m=None if last is None else last.position_ned_m,
            since_last_s=(now_us - self.last_us) * 1e-6,
            held_s=min(flight.reflex.loss_s or HELD_S, HELD_S) + NOTICED_S,
            known=known_surfaces(flight),
        )
        target, reason = bounded(wanted, around, flight.mission.fence, flight.mission.limits)
        if reason != self.limited_by and now_us - self.told_us >= LEAST_BETWEEN_LIMITS_US:
            self.limited_by, self.told_us = reason, now_us
            text = f"setpoint held back: {reason}" if reason else "setpoint free again"
            flight.report(now_us, "envelope", text, reason=reason)
        self.last, self.last_us = target, now_us
        return target

    def in_vehicles_view(self, flight: FlightContext, target: Target, has_floor: bool, time_boot_us: int) -> Target:
        """With the errors of the vehicle's estimate, so that it flies what was passed; within fence and limits, too.

        Raises SetpointError for one that is not finite.
        """
        wrong = None if target.lean is not None else flight.reflex.left_wrong(time_boot_us)
        if wrong is None:
            return target
        sent = replace(
            target,
            position_ned_m=plus(target.position_ned_m, wrong.share, wrong.position_m),
            velocity_ned_m_s=plus(target.velocity_ned_m_s or ZERO, wrong.share, wrong.velocity_m_s),
            acceleration_ned_m_s2=plus(target.acceleration_ned_m_s2 or ZERO, -wrong.share, wrong.pushed_m_s2),
        )
        around = Surroundings(None, flight.origin_ned_m, has_floor)
        return bounded(sent, around, flight.mission.fence, flight.mission.limits)[0]
