"""The one table of the flight: safe, without a dead end, and the source of its own pictures."""

import pytest

from companion.flight.states import FINAL_STATES, TABLE, State, Trigger
from companion.guard import states as guard_states

BEFORE_THE_FLIGHT = {State.CONNECT, State.READY}
IN_THE_AIR = set(State) - set(FINAL_STATES) - BEFORE_THE_FLIGHT - {State.CRASHED}


@pytest.mark.parametrize("state", [state for state in State if state not in FINAL_STATES])
def test_every_state_can_be_interrupted_and_a_refusal_counts_until_the_vehicle_has_taken_off(state):
    assert TABLE.next_state(state, Trigger.INTERRUPTED) is State.ABORTED
    refused = State.ABORTED if state in {*BEFORE_THE_FLIGHT, State.TAKEOFF} else state
    assert TABLE.next_state(state, Trigger.REFUSED) is refused


@pytest.mark.parametrize("state", [state for state in State if state in IN_THE_AIR])
def test_in_the_air_whoever_takes_control_has_it_and_every_hit_is_recovered_from(state):
    assert TABLE.next_state(state, Trigger.CONTROL_LOST) is State.ABORTED
    assert TABLE.next_state(state, Trigger.COLLISION) is State.RECOVERING
    assert TABLE.next_state(state, Trigger.CRASHED) is State.CRASHED


def test_a_crash_ends_with_a_disarm_or_in_other_hands_and_no_hit_or_mode_brings_the_flight_back():
    assert set(TABLE.rows[State.CRASHED]) == {Trigger.INTERRUPTED, Trigger.DISARMED, Trigger.FLIES_AGAIN}
    assert set(TABLE.rows[State.CRASHED].values()) == {State.ABORTED}


@pytest.mark.parametrize("state", [state for state in State if state not in IN_THE_AIR])
def test_before_and_after_a_flight_there_is_no_hit_to_answer(state):
    assert TABLE.next_state(state, Trigger.COLLISION) is state


@pytest.mark.parametrize(
    ("table", "start", "ends"),
    [
        (TABLE, State.CONNECT, set(FINAL_STATES)),
        (guard_states.TABLE, guard_states.State.CONNECTING, {guard_states.State.ENDED}),
    ],
    ids=["flight", "guard"],
)
def test_each_state_is_reached_and_only_the_ends_have_no_way_out(table, start, ends):
    reached, frontier = {start}, [start]
    while frontier:
        for target in set(table.rows[frontier.pop()].values()) - reached:
            reached.add(target)
            frontier.append(target)
    assert reached == set(start.__class__) == set(table.rows)
    assert {state for state in reached if not table.rows[state]} == ends
