"""Runs the guard's table: looks for triggers, moves between states, makes each state's activity."""

import math
import traceback
from dataclasses import dataclass

from companion.estimate.rotation import yaw_rad
from companion.flight.after_hit import note_before
from companion.flight.authority import Holder, who_decided
from companion.flight.early_end import HEARD_AGAIN
from companion.flight.recovering import Recover, record_collision
from companion.flight.states import State as FlightState
from companion.guard.context import Activity, GuardContext, GuardInputs, Move
from companion.guard.holding import GiveBack, Recovering, TakeOver
from companion.guard.override import has_moved
from companion.guard.standing_down import StandDown
from companion.guard.states import HOLDING, TABLE, State, Trigger
from companion.guard.watching import Connect, End, StandBy, Watch
from companion.px4_mode import OFFBOARD, mode_name

# What is told of a move that has a story.
_KINDS = {
    Trigger.CONTROL_LOST: "let_go",
    Trigger.NOT_CONFIRMED: "refused",
    Trigger.BLIND: "link",
    Trigger.CROSSED: "crossed",
    Trigger.WORTH_GUARDING: "watching",
    Trigger.NOT_TO_GUARD: "watching",
    Trigger.ENABLED: "enabled",
    Trigger.STREAMS_GONE: "link",
    Trigger.STOPPED: "stopped",
    Trigger.REFUSED: "ended",
}
STICKS = "the pilot moved the sticks"
# In these cases a program sends setpoints on a link of its own.
_BESIDE_PROGRAM = (Trigger.HIT_BESIDE_PROGRAM, Trigger.CROSSED)
# After these the vehicle is given back to hold whatever is configured.
_TO_HOLD = (Trigger.STOPPED, Trigger.HIT_BESIDE_PROGRAM, Trigger.NOT_CONFIRMED, Trigger.BLIND, Trigger.CROSSED)


@dataclass(slots=True)
class GuardMachine:
    """The present state and what is being done in it. The same inputs always give the same moves."""

    guard: GuardContext
    activity: Activity
    state: State = State.CONNECTING
    outcome: str = ""  # why it ended

    @property
    def holds(self) -> bool:
        """Whether the guard wants the vehicle for itself."""
        return self.state in HOLDING or (isinstance(self.activity, StandDown) and self.activity.hands_over)

    def step(self, inputs: GuardInputs, now_us: int) -> bool:
        """Take all moves that are due; whether there were any."""
        before = self.activity
        self._take(self._from_outside(inputs, now_us), now_us)
        for estimate in inputs.flight.impacts:
            trigger = self._trigger_of_hit()
            if trigger is Trigger.HIT_BESIDE_PROGRAM and self.guard.config.beside_program == "tell":
                self.guard.left_alone += 1
                text = f"hit at {math.hypot(*estimate.velocity_ned_m_s):.2f} m/s left to the program that flies"
                self.guard.flight.tell(now_us, "left_alone", text, impact_velocity_ned_m_s=estimate.velocity_ned_m_s)
            elif TABLE.moves(self.state, trigger):
                self._remember_hit(now_us)
                is_first = self.state is State.WATCHING
                note_before(self.guard.flight, FlightState.MISSION if is_first else FlightState.RECOVERING)
                record_collision(self.guard.flight, estimate, now_us)
                self._take(Move(trigger), now_us)
        move = self.activity.step(self.guard, inputs, now_us)
        while move is not None and TABLE.moves(self.state, move.trigger):
            self._take(move, now_us)
            # The answers and positions of this step belong to the state that asked for them.
            move = self.activity.step(self.guard, GuardInputs(), now_us)
        return self.activity is not before

    def fail(self, error: Exception, now_us: int) -> bool:
        """This program is at fault: give the vehicle back while that can still be done, and say what happened."""
        flight, before = self.guard.flight, self.activity
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"fault of the guard, please report it: {type(error).__name__} in {place.name}: {error}"
        flight.tell(now_us, "fault", text, traceback="".join(traceback.format_exception(error)))
        if flight.fault or self.state is State.GIVING_BACK:
            # even giving back fails: silence lets the vehicle's own failsafe act
            self.state, self.activity, self.outcome = State.ENDED, End(), text
        flight.fault = text
        try:
            self._take(Move(Trigger.STOPPED, text), now_us)
        except Exception as second:
            # what gives back fails, too
            flight.tell(now_us, "fault", f"and again: {second}", traceback="".join(traceback.format_exception(second)))
            self.state, self.activity, self.outcome = State.ENDED, End(), text
        return self.activity is not before

    def _trigger_of_hit(self) -> Trigger:
        """A program on another link goes on sending, in whatever mode; two streams would fight for the vehicle."""
        guard = self.guard
        beside = guard.flight.vehicle.custom_mode == OFFBOARD and not guard.keeps_others_out
        beside = guard.program_elsewhere or (beside and self.state is State.WATCHING)
        beside = beside and TABLE.moves(self.state, Trigger.HIT_BESIDE_PROGRAM)
        return Trigger.HIT_BESIDE_PROGRAM if beside else Trigger.HIT

    def _remember_hit(self, now_us: int) -> None:
        guard, flight = self.guard, self.guard.flight
        guard.hits += 1
        if self.state is not State.WATCHING:
            return
        guard.previous_mode = flight.expected_mode = flight.vehicle.custom_mode
        guard.then_hold, flight.target = "", None
        attitude = flight.vehicle.attitude
        flight.yaw_rad = None if attitude is None else yaw_rad(attitude.attitude_wxyz)

    def _from_outside(self, inputs: GuardInputs, now_us: int) -> Move | None:
        """What ends a state whatever is being done in it; the pilot's before all others, but for a disarm."""
        flight = self.guard.flight
        flight.note_silence(now_us)
        if flight.vehicle.armed is False and TABLE.moves(self.state, Trigger.DISARMED):
            return Move(Trigger.DISARMED, "disarmed")
        if self.state in HOLDING:
            lost = self._taken_by_another(inputs) or self._link_silent(now_us)
            if lost is not None:
                return Move(Trigger.CONTROL_LOST, f"{lost}; the guard lets go and stands down")
        if inputs.flight.refusal is not None:
            return Move(Trigger.REFUSED, inputs.flight.refusal)
        if inputs.flight.stop_reason is not None and TABLE.moves(self.state, Trigger.STOPPED):
            return Move(Trigger.STOPPED, inputs.flight.stop_reason)
        return self._position_silent() if self.state in HOLDING else self._heard_again(now_us)

    def _taken_by_another(self, inputs: GuardInputs) -> str | None:
        guard, flight = self.guard, self.guard.flight
        report, expected = flight.vehicle.mode, flight.expected_mode
        if guard.sticks is not None and any(has_moved(guard.sticks, now) for now in inputs.sticks):
            return STICKS
        if report is None or expected is None:
            return None
        if self.state is State.GIVING_BACK and report.custom_mode == OFFBOARD:
            # Late: it was asked for, and given up.
            flight.expected_mode = expected = OFFBOARD
        requested = flight.command_client.requested_mode
        if isinstance(self.activity, GiveBack):
            requested = self.activity.wish
        holder = who_decided(report, expected, requested)
        if holder is Holder.COMPANION:
            return None
        who = "a failsafe of the vehicle" if holder is Holder.FAILSAFE else "the pilot or a program"
        return f"{who} took over in {mode_name(report.custom_mode)}"

    def _link_silent(self, now_us: int) -> str | None:
        silent_s = self.guard.flight.silent_s(now_us)
        if silent_s <= self.guard.config.companion.link.silence_s:
            return None
        return f"the link has been silent for {silent_s:.1f} s"

    def _heard_again(self, now_us: int) -> Move | None:
        """What was restarted stands, or is being met; what flies has not forgotten what it was asked for."""
        flight = self.guard.flight
        may_be_restarted = self.state is State.CONNECTING or flight.vehicle.armed is False
        if not may_be_restarted or flight.is_silent(now_us) or not flight.was_silent:
            return None
        return Move(Trigger.STREAMS_GONE, HEARD_AGAIN)

    def _position_silent(self) -> Move | None:
        silent_s = self.guard.flight.position_silent_s
        if silent_s <= self.guard.config.companion.link.position_silence_s:
            return None
        return Move(Trigger.BLIND, f"no LOCAL_POSITION_NED for {silent_s:.1f} s, though the link is alive")

    def _take(self, move: Move | None, now_us: int) -> None:
        if move is None or not TABLE.moves(self.state, move.trigger):
            return
        self.state = TABLE.next_state(self.state, move.trigger)
        guard = self.guard
        if move.text:
            guard.flight.tell(now_us, _KINDS.get(move.trigger, "guard"), move.text)
        if move.trigger in _TO_HOLD:
            guard.then_hold = move.text or move.trigger.value
        self.activity = self._begin(move, now_us)

    def _begin(self, move: Move, now_us: int) -> Activity:
        guard, flight = self.guard, self.guard.flight
        if self.state not in HOLDING:
            flight.command_client.cancel()
            flight.expected_mode = None
            if flight.collisions:
                flight.collisions[-1].is_over = True
        match self.state:
            case State.CONNECTING:
                return Connect(now_us, is_first=False)
            case State.STANDING_BY:
                return StandBy()
            case State.WATCHING:
                return Watch(guard, now_us)
            case State.TAKING_OVER:
                return self._take_over(now_us)
            case State.RECOVERING:
                recover = Recover(flight, now_us) if move.trigger is Trigger.HIT else self._recover()
                return Recovering(recover, now_us)
            case State.GIVING_BACK:
                self._limit_hits()
                return GiveBack(guard, move.trigger in _BESIDE_PROGRAM, now_us)
            case State.STOOD_DOWN:
                return StandDown(guard, move.text.startswith(STICKS), now_us)
            case State.ENDED:
                self.outcome = move.text
                return End()

    def _take_over(self, now_us: int) -> Activity:
        guard, flight = self.guard, self.guard.flight
        mode = "" if guard.previous_mode is None else mode_name(guard.previous_mode)
        flight.tell(now_us, "take_over", f"taking over from {mode}", mode=mode)
        flight.command_client.cancel()
        return TakeOver(guard, Recover(flight, now_us), now_us)

    def _recover(self) -> Recover:
        assert isinstance(self.activity, TakeOver), "the table leads here from there alone"
        return self.activity.recover

    def _limit_hits(self) -> None:
        guard, limit = self.guard, self.guard.config.max_hits
        if guard.hits >= limit and not guard.then_hold:
            guard.then_hold = f"hit {guard.hits} of at most {limit}"
