"""The one table of the guard: whoever takes the vehicle has it, and no state is a dead end."""

import pytest

from companion.autopilot.px4.firmware import PX4
from companion.guard.machine import has_moved
from companion.guard.states import HOLDING, TABLE, State, Trigger
from companion.messages import Sticks


@pytest.mark.parametrize("state", [state for state in State if state in HOLDING])
def test_while_the_guard_holds_whoever_takes_the_vehicle_has_it_and_every_failure_gives_it_back(state):
    assert TABLE.next_state(state, Trigger.CONTROL_LOST) is State.STOOD_DOWN
    assert TABLE.next_state(state, Trigger.DISARMED) is State.STANDING_BY
    for trigger in (Trigger.STOPPED, Trigger.POSITION_SILENT):
        assert TABLE.next_state(state, trigger) is State.GIVING_BACK


def test_only_a_person_a_failsafe_a_disarm_or_a_crash_lets_go_of_a_recovery():
    lets_go = {trigger for trigger, state in TABLE.rows[State.RECOVERING].items() if state not in HOLDING}
    assert lets_go == {Trigger.CONTROL_LOST, Trigger.DISARMED, Trigger.CRASHED}


def test_a_crash_is_told_wherever_hits_are_answered_and_ends_with_a_disarm_or_a_take_off():
    assert {state for state in State if TABLE.moves(state, Trigger.CRASHED)} == {*HOLDING, State.WATCHING}
    ends = {trigger for trigger, state in TABLE.rows[State.CRASHED].items() if state is State.STANDING_BY}
    assert ends == {Trigger.DISARMED, Trigger.FLIES_AGAIN} and State.CRASHED not in HOLDING


def test_a_hit_is_answered_where_the_guard_watches_and_never_takes_the_vehicle_back():
    answered = {state for state in State if TABLE.next_state(state, Trigger.HIT) in HOLDING}
    assert answered == {State.WATCHING, State.TAKING_OVER, State.RECOVERING, State.GIVING_BACK}
    assert TABLE.next_state(State.STOOD_DOWN, Trigger.ENABLED) is State.STANDING_BY


@pytest.mark.parametrize(
    ("before", "now", "counts"),
    [
        ((0.0, 0.0, 0.0, 0.0), (0.29, -0.29, 0.0, 0.29), False),
        ((0.0, 0.0, 0.0, 0.0), (0.31, 0.0, 0.0, 0.0), True),
        ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, -0.31), True),
        ((0.8, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), False),  # let go, as a startled pilot does
        ((0.0, 0.0, -1.0, 0.0), (0.0, 0.0, -0.71, 0.0), False),  # a throttle lies anywhere
        ((0.0, 0.0, -1.0, 0.0), (0.0, 0.0, -0.69, 0.0), True),
    ],
)
def test_sticks_count_as_moved_beyond_px4s_thirty_percent(before, now, counts):
    assert has_moved(Sticks(before), Sticks(now), PX4.defaults.stick_override) is counts
