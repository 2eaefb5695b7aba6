"""The modes' numbers and every row of the one table."""

import pytest

from sim_vehicle.autopilot.modes import (
    NEEDS,
    TRANSITIONS,
    Conditions,
    Mode,
    ModeEvent,
    ModeState,
    Need,
    Transition,
    find_transition,
)

EVERYTHING = frozenset(Need)
DISARMED = Conditions(False)
ASKED_FOR = [row.target for row in TRANSITIONS if row.event is ModeEvent.REQUEST]


def armed(*missing: Need) -> Conditions:
    return Conditions(True, EVERYTHING - set(missing))


@pytest.mark.parametrize("mode", ASKED_FOR)
def test_armed_a_mode_is_accepted_that_has_what_it_needs(mode):
    assert find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(), mode) is not None
    for need in NEEDS[mode]:
        without = find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(need), mode)
        # LAND must always be there, be it without a position
        assert (without is not None) == (mode is Mode.LAND), need


@pytest.mark.parametrize("ends_in", [Mode.LAND, Mode.RETURN, Mode.TAKEOFF, Mode.ORBIT, Mode.FOLLOW_TARGET])
def test_after_disarming_the_mode_before_is_meant(ends_in):
    # Given a flight in OFFBOARD that went on in a mode in which nobody can arm
    state = ModeState()
    assert state.apply(ModeEvent.REQUEST, armed(), Mode.OFFBOARD)
    assert state.apply(ModeEvent.REQUEST, armed(), ends_in)
    # When the vehicle disarms
    assert state.apply(ModeEvent.DISARMED, DISARMED)
    # Then OFFBOARD is meant again
    assert state.intended is Mode.OFFBOARD


@pytest.mark.parametrize("row", TRANSITIONS, ids=lambda row: f"{row.event}-{row.target}")
def test_every_row_can_happen_and_no_earlier_one_hides_it(row: Transition):
    source = row.sources[0] if row.sources else Mode.LOITER
    assert find_transition(source, row.event, armed(), row.target) is row
