"""The modes' numbers and every row of the one table."""

import pytest

from sim_vehicle.autopilot.mode_numbers import NUMBERS, base_mode, mode_from_request
from sim_vehicle.autopilot.modes import (
    NEEDS,
    TRANSITIONS,
    Conditions,
    Mode,
    ModeCondition,
    ModeEvent,
    ModeState,
    Need,
    Transition,
    find_transition,
    mode_diagram,
)

EVERYTHING = frozenset(Need)
DISARMED = Conditions(False)
ASKED_FOR = [row.target for row in TRANSITIONS if row.event is ModeEvent.REQUEST]


def armed(*missing: Need) -> Conditions:
    return Conditions(True, EVERYTHING - set(missing))


def test_the_numbers_on_the_wire_are_those_measured():
    # Given the table measured on PX4, main << 16 | sub << 24
    measured = {
        Mode.MANUAL: (0x51, 1 << 16),
        Mode.ALTCTL: (0x51, 2 << 16),
        Mode.POSCTL: (0x51, 3 << 16),
        Mode.STABILIZED: (0x51, 7 << 16),
        Mode.TAKEOFF: (0x1D, 0x02040000),
        Mode.LOITER: (0x1D, 0x03040000),
        Mode.MISSION: (0x1D, 0x04040000),
        Mode.RETURN: (0x1D, 0x05040000),
        Mode.LAND: (0x1D, 0x06040000),
        # And those of px4_custom_mode.h
        Mode.ORBIT: (0x1D, 0x01030000),
        Mode.FOLLOW_TARGET: (0x1D, 0x08040000),
        Mode.DESCEND: (0x1D, 0x06040000),
        Mode.TERMINATION: (0x01, 10 << 16),
    }
    for mode, (base, custom) in measured.items():
        assert base_mode(mode, armed=False, had_setpoint=False) == base, mode
        assert base_mode(mode, armed=True, had_setpoint=True) == base | 0x80, mode
        assert NUMBERS[mode].custom_mode == custom, mode
    # And OFFBOARD, which is stabilised only once a setpoint has come
    assert NUMBERS[Mode.OFFBOARD].custom_mode == 0x00060000
    assert base_mode(Mode.OFFBOARD, armed=False, had_setpoint=False) == 0x01
    assert base_mode(Mode.OFFBOARD, armed=False, had_setpoint=True) == 0x11
    assert base_mode(Mode.OFFBOARD, armed=True, had_setpoint=True) == 0x91


@pytest.mark.parametrize("mode", ASKED_FOR)
@pytest.mark.parametrize("before", [Mode.LOITER, Mode.OFFBOARD, Mode.MANUAL, Mode.LAND])
def test_disarmed_every_mode_is_accepted(before, mode):
    row = find_transition(before, ModeEvent.REQUEST, DISARMED, mode)
    assert row is not None and row.target is mode


@pytest.mark.parametrize("mode", ASKED_FOR)
def test_armed_a_mode_is_accepted_that_has_what_it_needs(mode):
    assert find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(), mode) is not None
    for need in NEEDS[mode]:
        without = find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(need), mode)
        # LAND must always be there, be it without a position
        assert (without is not None) == (mode is Mode.LAND), need


def test_armed_without_sticks_setpoints_and_mission_only_these_can_fly():
    bare = armed(Need.STICKS, Need.SETPOINTS, Need.MISSION)
    flown = {mode for mode in ASKED_FOR if find_transition(Mode.LOITER, ModeEvent.REQUEST, bare, mode)}
    assert flown == {
        *(Mode.LOITER, Mode.RETURN, Mode.TAKEOFF, Mode.LAND, Mode.PRECISION_LAND, Mode.FOLLOW_TARGET, Mode.ORBIT),
        Mode.TERMINATION,
    }


def test_takeoff_ends_in_hold():
    assert find_transition(Mode.TAKEOFF, ModeEvent.TAKEOFF_REACHED, armed()).target is Mode.LOITER
    assert find_transition(Mode.OFFBOARD, ModeEvent.TAKEOFF_REACHED, armed()) is None


def test_sticks_take_over_from_every_mode_that_flies_without_them():
    for mode in (Mode.OFFBOARD, Mode.MISSION, Mode.LOITER, Mode.LAND, Mode.RETURN):
        assert find_transition(mode, ModeEvent.STICKS, armed()).target is Mode.POSCTL
    assert find_transition(Mode.ALTCTL, ModeEvent.STICKS, armed()) is None
    assert find_transition(Mode.TERMINATION, ModeEvent.STICKS, armed()) is None


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


def test_disarming_in_hold_changes_nothing():
    state = ModeState()
    assert not state.apply(ModeEvent.DISARMED, DISARMED)
    assert state.intended is Mode.LOITER


def test_nothing_leads_out_of_termination():
    state = ModeState()
    state.flown = Mode.TERMINATION
    for mode in ASKED_FOR:
        assert not state.apply(ModeEvent.REQUEST, DISARMED, mode)
    assert not state.apply(ModeEvent.DISARMED, DISARMED)


@pytest.mark.parametrize("row", TRANSITIONS, ids=lambda row: f"{row.event}-{row.target}")
def test_every_row_can_happen_and_no_earlier_one_hides_it(row: Transition):
    source = row.sources[0] if row.sources else Mode.LOITER
    assert find_transition(source, row.event, armed(), row.target) is row


def test_the_diagram_shows_every_row():
    diagram = mode_diagram()
    assert diagram.startswith("stateDiagram-v2\n    [*] --> LOITER\n")
    arrows = sum(len(row.sources or (None,)) for row in TRANSITIONS)
    assert diagram.count("-->") == 1 + arrows
    assert "    ANY_MODE --> OFFBOARD: requested [disarmed, or setpoints arrive]\n" in diagram
    assert "    LAND --> MODE_BEFORE: disarmed\n" in diagram
    assert ModeCondition.CAN_RUN not in diagram


@pytest.mark.parametrize(
    ("base", "main", "sub", "mode"),
    [
        (1, 6, 0, Mode.OFFBOARD),
        (1, 4, 0, Mode.MISSION),
        (1, 4, 6, Mode.LAND),
        (1, 4, 8, Mode.FOLLOW_TARGET),
        (1, 3, 0, Mode.POSCTL),
        (1, 3, 1, Mode.POSCTL),
        (1, 10, 0, None),
        (1, 4, 99, None),
        (1, 0, 0, None),
        (1, 77, 0, None),
        (4, 0, 0, Mode.MISSION),
        (64, 0, 0, Mode.MANUAL),
        (64 | 16, 0, 0, Mode.STABILIZED),
        (64 | 8, 0, 0, Mode.POSCTL),
        (0, 6, 0, None),
    ],
)
def test_what_do_set_mode_names(base, main, sub, mode):
    assert mode_from_request(base, main, sub) is mode
