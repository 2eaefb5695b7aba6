"""The one table of the flight: complete, safe, and the source of its own pictures."""

import pytest

from companion.flight.states import FINAL_STATES, TABLE, State, Trigger

EXPECTED = {
    (State.CONNECT, Trigger.REFUSED): State.ABORTED,
    (State.CONNECT, Trigger.INTERRUPTED): State.ABORTED,
    (State.CONNECT, Trigger.VEHICLE_READY): State.READY,
    (State.READY, Trigger.REFUSED): State.ABORTED,
    (State.READY, Trigger.INTERRUPTED): State.ABORTED,
    (State.CONNECT, Trigger.LINK_RESTORED): State.CONNECT,
    (State.READY, Trigger.LINK_RESTORED): State.CONNECT,
    (State.READY, Trigger.PLAN_CONFIRMED): State.TAKEOFF,
    (State.TAKEOFF, Trigger.CONTROL_LOST): State.ABORTED,
    (State.TAKEOFF, Trigger.REFUSED): State.ABORTED,
    (State.TAKEOFF, Trigger.INTERRUPTED): State.ABORTED,
    (State.TAKEOFF, Trigger.COLLISION): State.RECOVERING,
    (State.TAKEOFF, Trigger.TAKEN_OFF): State.MISSION,
    (State.MISSION, Trigger.CONTROL_LOST): State.ABORTED,
    (State.MISSION, Trigger.INTERRUPTED): State.ABORTED,
    (State.MISSION, Trigger.COLLISION): State.RECOVERING,
    (State.MISSION, Trigger.RETURN_DUE): State.RETURNING,
    (State.MISSION, Trigger.LAND_DUE): State.LANDING,
    (State.RECOVERING, Trigger.CONTROL_LOST): State.ABORTED,
    (State.RECOVERING, Trigger.INTERRUPTED): State.ABORTED,
    (State.RECOVERING, Trigger.COLLISION): State.RECOVERING,
    (State.RECOVERING, Trigger.RECOVERED_TO_HOLD): State.HOLDING,
    (State.RECOVERING, Trigger.RECOVERED_TO_CONTINUE): State.MISSION,
    (State.RECOVERING, Trigger.RECOVERED_TO_RETRY): State.MISSION,
    (State.RECOVERING, Trigger.RECOVERED_TO_DETOUR): State.MISSION,
    (State.RECOVERING, Trigger.RECOVERED_TO_RETURN): State.RETURNING,
    (State.RECOVERING, Trigger.RECOVERED_TO_LAND): State.LANDING,
    (State.RECOVERING, Trigger.RECOVERED_TO_ABORT): State.ABORTED,
    (State.HOLDING, Trigger.CONTROL_LOST): State.ABORTED,
    (State.HOLDING, Trigger.INTERRUPTED): State.ABORTED,
    (State.HOLDING, Trigger.COLLISION): State.RECOVERING,
    (State.HOLDING, Trigger.HOLD_ENDED): State.MISSION,
    (State.RETURNING, Trigger.CONTROL_LOST): State.ABORTED,
    (State.RETURNING, Trigger.INTERRUPTED): State.ABORTED,
    (State.RETURNING, Trigger.COLLISION): State.RECOVERING,
    (State.RETURNING, Trigger.HOME_REACHED): State.LANDING,
    (State.RETURNING, Trigger.LAND_DUE): State.LANDING,
    (State.LANDING, Trigger.CONTROL_LOST): State.ABORTED,
    (State.LANDING, Trigger.INTERRUPTED): State.ABORTED,
    (State.LANDING, Trigger.COLLISION): State.RECOVERING,
    (State.LANDING, Trigger.DISARMED): State.DONE,
}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("trigger", Trigger)
def test_every_pair_of_state_and_trigger(state, trigger):
    """A trigger without meaning in a state changes nothing; there is no pair without an answer."""
    assert TABLE.next_state(state, trigger) is EXPECTED.get((state, trigger), state)


def test_the_table_has_a_row_for_every_state():
    assert set(TABLE.rows) == set(State)


def test_only_done_and_aborted_are_final_and_every_other_state_can_be_interrupted():
    assert set(FINAL_STATES) == {State.DONE, State.ABORTED}
    for state in set(State) - FINAL_STATES:
        assert TABLE.next_state(state, Trigger.INTERRUPTED) is State.ABORTED


def test_every_state_is_reachable_from_connect():
    reached, frontier = {State.CONNECT}, [State.CONNECT]
    while frontier:
        for target in TABLE.rows[frontier.pop()].values():
            if target not in reached:
                reached.add(target)
                frontier.append(target)
    assert reached == set(State)
