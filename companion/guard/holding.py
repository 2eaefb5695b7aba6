"""States taking over, recovering and giving back: the vehicle flies, or is about to fly, by the guard's setpoints."""

import math

from companion.flight.context import Inputs, Target
from companion.flight.recovering import Recover
from companion.guard.aside import StepAside
from companion.guard.context import GuardContext, GuardInputs, Move
from companion.guard.states import Trigger
from companion.messages import PositionTarget, SetMode
from companion.px4_mode import AUTO_LAND, AUTO_LOITER, OFFBOARD, mode_name

# The vehicle tells what it flies to. Further than this from all that was sent it is somebody else's: a moving
# setpoint of ours is 0.24 m further on at most from one to the next, at 12 m/s.
CROSSED_M = 0.5
# A mixed-up echo is one, three are a second stream.
CROSSED_TIMES = 3
# What is echoed was sent at most this long ago: a slow echo's period of 0.1 s and the link's delays.
ECHO_AGE_US = 400_000
# The first echoes may still be of the mode before.
ECHO_STALE_US = 200_000


class TakeOver:
    """The recovery has begun with the first setpoint; here until the vehicle is seen to fly by it."""

    def __init__(self, guard: GuardContext, recover: Recover, now_us: int) -> None:
        self.recover = recover
        self._began_us = now_us
        flight = guard.flight
        if flight.vehicle.custom_mode != OFFBOARD:
            flight.command_client.begin(SetMode(OFFBOARD))

    def target(self, now_us: int) -> Target | None:
        return self.recover.target(now_us)

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        flight = guard.flight
        is_seen = flight.vehicle.custom_mode == OFFBOARD
        outcome = flight.command_outcome(inputs.flight, is_seen, now_us)
        took_ms = (now_us - self._began_us) / 1e3
        if is_seen:
            flight.expected_mode = OFFBOARD
            text = "OFFBOARD already, the program's setpoints kept out" if outcome is None else "OFFBOARD confirmed"
            flight.tell(now_us, "confirmed", f"{text} after {took_ms:.0f} ms", after_ms=took_ms)
            return Move(Trigger.CONFIRMED)
        recovered(guard, self.recover, inputs.flight, now_us)
        if outcome is not None:
            return Move(Trigger.NOT_CONFIRMED, outcome.text)
        if took_ms > guard.config.confirm_within_s * 1e3:
            return Move(Trigger.NOT_CONFIRMED, f"OFFBOARD not seen within {guard.config.confirm_within_s:g} s")
        return None


class Recovering:
    """Until the vehicle rests clear of what it hit."""

    def __init__(self, recover: Recover, now_us: int) -> None:
        self._recover = recover
        self._began_us = now_us
        self._foreign = 0

    def target(self, now_us: int) -> Target | None:
        return self._recover.target(now_us)

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        if now_us - self._began_us > ECHO_STALE_US:
            self._foreign += sum(is_foreign(guard, echo, now_us) for echo in inputs.echoes)
        if self._foreign >= CROSSED_TIMES:
            guard.program_elsewhere = True
            return Move(Trigger.CROSSED, "another program's setpoints reach the vehicle, on a link of its own")
        return Move(Trigger.SETTLED) if recovered(guard, self._recover, inputs.flight, now_us) else None


def recovered(guard: GuardContext, recover: Recover, inputs: Inputs, now_us: int) -> bool:
    """One step of the recovery; whether it is over, be it that the hit was none, which then does not count."""
    before = guard.flight.unconfirmed
    is_over = recover.step(guard.flight, inputs, now_us) is not None
    guard.hits -= guard.flight.unconfirmed - before
    return is_over


def is_foreign(guard: GuardContext, echo: PositionTarget, now_us: int) -> bool:
    """Whether the vehicle flies to a place, or by a velocity alone, that the guard has not lately asked for."""
    recent = [place for sent_us, place in guard.sent_ned_m if now_us - sent_us <= ECHO_AGE_US]
    if echo.position_ned_m is None:
        return None not in recent
    return all(place is None or math.dist(place, echo.position_ned_m) > CROSSED_M for place in recent)


class GiveBack:
    """Ask for one mode after the other until one is seen; setpoints go on meanwhile.

    The first is asked for straight after a report of the present one: a person's own request that shows there is not
    overruled. One that crosses ours on the link, within its delay of about 10 ms, cannot be seen by anybody.

    A program's own OFFBOARD needs no asking: its setpoints are let through again. Beside a program on
    another link nothing is streamed; the vehicle is asked to hold clear of what it hit. When no mode is taken the
    setpoints stop, and PX4's action for lost setpoints follows.
    """

    def __init__(self, guard: GuardContext, beside_program: bool, now_us: int) -> None:
        flight, previous = guard.flight, guard.previous_mode
        self._wishes: list[int] = []
        if guard.config.then == "previous" and not guard.then_hold and previous is not None:
            self._wishes.append(previous)
        self._wishes += [AUTO_LOITER, AUTO_LAND]
        self._target = flight.target.at_rest() if flight.target else None
        self._aside: StepAside | None = None
        if beside_program:
            self._target = None
            self._aside = StepAside(now_us)
        self._began_us = now_us
        self._is_asked = False

    def target(self, now_us: int) -> Target | None:
        return self._target

    @property
    def wish(self) -> int:
        return self._wishes[0]

    def _ask(self, guard: GuardContext) -> None:
        if guard.flight.vehicle.custom_mode != self.wish:
            guard.flight.command_client.begin(SetMode(self.wish))

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        flight = guard.flight
        if self._aside is not None and not self._aside.is_over:
            self._aside.step(guard, inputs, now_us)
            if not self._aside.is_over:
                return None
            # It asked for the first of these modes, too.
            self._is_asked = True
            self._ask(guard)
            inputs = GuardInputs()
        if not self._is_asked:
            if not flight.is_time_to_give_away(self._began_us, now_us):
                return None
            self._is_asked = True
            self._ask(guard)
        is_seen = flight.vehicle.custom_mode == self.wish
        outcome = flight.command_outcome(inputs.flight, is_seen, now_us)
        if is_seen:
            took_ms = (now_us - self._began_us) / 1e3
            text = f"given back to {mode_name(self.wish)} after {took_ms:.0f} ms"
            flight.tell(now_us, "given_back", text, mode=mode_name(self.wish), after_ms=took_ms)
            return Move(Trigger.GIVEN_BACK)
        if outcome is None:
            return None
        self._wishes.pop(0)
        if not self._wishes:
            return Move(Trigger.CONTROL_LOST, "the vehicle takes no mode; setpoints stopped")
        self._ask(guard)
        # The answers of this step were to the mode before.
        return self.step(guard, GuardInputs(Inputs(positions=inputs.flight.positions)), now_us)
