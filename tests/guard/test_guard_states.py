"""The one table of the guard: complete, and the source of its own pictures."""

import pytest

from companion.guard.machine import has_moved
from companion.guard.states import HOLDING, TABLE, State, Trigger
from companion.messages import Sticks

EXPECTED = {
    (State.CONNECTING, Trigger.REFUSED): State.ENDED,
    (State.CONNECTING, Trigger.STOPPED): State.ENDED,
    (State.CONNECTING, Trigger.STREAMS_GONE): State.CONNECTING,
    (State.CONNECTING, Trigger.CONNECTED): State.STANDING_BY,
    (State.STANDING_BY, Trigger.STOPPED): State.ENDED,
    (State.STANDING_BY, Trigger.WORTH_GUARDING): State.WATCHING,
    (State.STANDING_BY, Trigger.STREAMS_GONE): State.CONNECTING,
    (State.WATCHING, Trigger.DISARMED): State.STANDING_BY,
    (State.WATCHING, Trigger.STOPPED): State.ENDED,
    (State.WATCHING, Trigger.HIT): State.TAKING_OVER,
    (State.WATCHING, Trigger.HIT_BESIDE_PROGRAM): State.GIVING_BACK,
    (State.WATCHING, Trigger.NOT_TO_GUARD): State.STANDING_BY,
    (State.TAKING_OVER, Trigger.DISARMED): State.STANDING_BY,
    (State.TAKING_OVER, Trigger.CONTROL_LOST): State.STOOD_DOWN,
    (State.TAKING_OVER, Trigger.STOPPED): State.GIVING_BACK,
    (State.TAKING_OVER, Trigger.HIT): State.TAKING_OVER,
    (State.TAKING_OVER, Trigger.CONFIRMED): State.RECOVERING,
    (State.TAKING_OVER, Trigger.NOT_CONFIRMED): State.GIVING_BACK,
    (State.TAKING_OVER, Trigger.POSITION_SILENT): State.GIVING_BACK,
    (State.RECOVERING, Trigger.DISARMED): State.STANDING_BY,
    (State.RECOVERING, Trigger.CONTROL_LOST): State.STOOD_DOWN,
    (State.RECOVERING, Trigger.STOPPED): State.GIVING_BACK,
    (State.RECOVERING, Trigger.HIT): State.RECOVERING,
    (State.RECOVERING, Trigger.POSITION_SILENT): State.GIVING_BACK,
    (State.RECOVERING, Trigger.CROSSED): State.GIVING_BACK,
    (State.RECOVERING, Trigger.SETTLED): State.GIVING_BACK,
    (State.GIVING_BACK, Trigger.DISARMED): State.STANDING_BY,
    (State.GIVING_BACK, Trigger.CONTROL_LOST): State.STOOD_DOWN,
    (State.GIVING_BACK, Trigger.HIT): State.TAKING_OVER,
    (State.GIVING_BACK, Trigger.HIT_BESIDE_PROGRAM): State.GIVING_BACK,
    (State.GIVING_BACK, Trigger.GIVEN_BACK): State.WATCHING,
    (State.STOOD_DOWN, Trigger.DISARMED): State.STANDING_BY,
    (State.STOOD_DOWN, Trigger.STOPPED): State.ENDED,
    (State.STOOD_DOWN, Trigger.ENABLED): State.STANDING_BY,
}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("trigger", Trigger)
def test_every_pair_of_state_and_trigger(state, trigger):
    """A trigger without meaning in a state changes nothing; there is no pair without an answer."""
    assert TABLE.next_state(state, trigger) is EXPECTED.get((state, trigger), state)


def test_the_table_has_a_row_for_every_state_and_each_is_reachable():
    assert set(TABLE.rows) == set(State)
    reached, frontier = {State.CONNECTING}, [State.CONNECTING]
    while frontier:
        for target in TABLE.rows[frontier.pop()].values():
            if target not in reached:
                reached.add(target)
                frontier.append(target)
    assert reached == set(State)


def test_whoever_takes_the_vehicle_from_the_guard_has_it_and_a_hit_never_takes_it_back():
    for state in HOLDING:
        assert TABLE.next_state(state, Trigger.CONTROL_LOST) is State.STOOD_DOWN
    assert TABLE.next_state(State.STOOD_DOWN, Trigger.HIT) is State.STOOD_DOWN
    assert TABLE.next_state(State.STANDING_BY, Trigger.HIT) is State.STANDING_BY


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
    assert has_moved(Sticks(before), Sticks(now)) is counts
