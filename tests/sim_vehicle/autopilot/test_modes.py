"""The modes' numbers and every row of the one table."""

import pytest

from sim_vehicle.autopilot.modes import (
    NUMBERS,
    TRANSITIONS,
    Conditions,
    Event,
    Guard,
    Mode,
    ModeState,
    Transition,
    base_mode,
    find_transition,
    mode_diagram,
    mode_from_request,
)

ARMED_WITH, ARMED_WITHOUT = Conditions(True, True), Conditions(True, False)
DISARMED = Conditions(False, False)
FLOWN = {Mode.POSCTL, Mode.LOITER, Mode.RETURN, Mode.TAKEOFF, Mode.LAND}
EVERY_MODE_THAT_CAN_BE_ASKED_FOR = [mode for mode in Mode if mode is not Mode.OFFBOARD_LOST]


def test_the_numbers_on_the_wire_are_those_measured():
    # Given the table measured on PX4, main << 16 | sub << 24
    measured = {
        Mode.MANUAL: (0x51, 1 << 16),
        Mode.ALTCTL: (0x51, 2 << 16),
        Mode.POSCTL: (0x51, 3 << 16),
        Mode.STABILIZED: (0x51, 7 << 16),
        Mode.ACRO: (0x41, 5 << 16),
        Mode.TAKEOFF: (0x1D, 0x02040000),
        Mode.LOITER: (0x1D, 0x03040000),
        Mode.MISSION: (0x1D, 0x04040000),
        Mode.RETURN: (0x1D, 0x05040000),
        Mode.LAND: (0x1D, 0x06040000),
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


@pytest.mark.parametrize("mode", EVERY_MODE_THAT_CAN_BE_ASKED_FOR)
@pytest.mark.parametrize("before", [Mode.LOITER, Mode.OFFBOARD, Mode.MANUAL, Mode.LAND])
def test_disarmed_every_mode_is_accepted(before, mode):
    row = find_transition(before, Event.REQUEST, DISARMED, mode)
    assert row is not None and row.target is mode


@pytest.mark.parametrize("mode", EVERY_MODE_THAT_CAN_BE_ASKED_FOR)
@pytest.mark.parametrize("before", [Mode.LOITER, Mode.OFFBOARD, Mode.OFFBOARD_LOST, Mode.TAKEOFF])
def test_armed_only_what_can_fly_is_accepted(before, mode):
    without = find_transition(before, Event.REQUEST, ARMED_WITHOUT, mode)
    with_setpoints = find_transition(before, Event.REQUEST, ARMED_WITH, mode)
    assert (without is not None) == (mode in FLOWN)
    assert (with_setpoints is not None) == (mode in FLOWN | {Mode.OFFBOARD})


def test_takeoff_ends_in_hold():
    assert find_transition(Mode.TAKEOFF, Event.TAKEOFF_REACHED, ARMED_WITHOUT).target is Mode.LOITER
    assert find_transition(Mode.OFFBOARD, Event.TAKEOFF_REACHED, ARMED_WITH) is None


def test_offboard_without_setpoints_is_a_failsafe_only_while_armed():
    assert find_transition(Mode.OFFBOARD, Event.SETPOINTS_LOST, ARMED_WITHOUT).target is Mode.OFFBOARD_LOST
    assert find_transition(Mode.OFFBOARD, Event.SETPOINTS_LOST, DISARMED) is None
    assert find_transition(Mode.LOITER, Event.SETPOINTS_LOST, ARMED_WITHOUT) is None


def test_setpoints_that_come_back_lead_into_offboard_again():
    assert find_transition(Mode.OFFBOARD_LOST, Event.SETPOINTS_BACK, ARMED_WITH).target is Mode.OFFBOARD
    assert find_transition(Mode.LOITER, Event.SETPOINTS_BACK, ARMED_WITH) is None


@pytest.mark.parametrize("ends_in", [Mode.LAND, Mode.RETURN, Mode.TAKEOFF])
def test_after_disarming_the_mode_before_is_shown(ends_in):
    # Given a flight in OFFBOARD that went on in a mode in which nobody can arm
    state = ModeState()
    assert state.apply(Event.REQUEST, ARMED_WITH, Mode.OFFBOARD)
    assert state.apply(Event.REQUEST, ARMED_WITH, ends_in)
    # When the vehicle disarms
    assert state.apply(Event.DISARMED, DISARMED)
    # Then OFFBOARD is shown again
    assert state.shown is Mode.OFFBOARD


def test_disarming_in_hold_changes_nothing():
    state = ModeState()
    assert not state.apply(Event.DISARMED, DISARMED)
    assert state.shown is Mode.LOITER


def test_in_the_failsafe_posctl_is_shown_and_offboard_is_meant():
    state = ModeState()
    state.apply(Event.REQUEST, ARMED_WITH, Mode.OFFBOARD)
    state.apply(Event.SETPOINTS_LOST, ARMED_WITHOUT)
    assert (state.shown, state.intended, state.in_failsafe) == (Mode.POSCTL, Mode.OFFBOARD, True)
    # And after landing and disarming, OFFBOARD again
    assert state.apply(Event.DISARMED, DISARMED)
    assert (state.shown, state.in_failsafe) == (Mode.OFFBOARD, False)


def test_a_pilots_request_ends_the_failsafe():
    state = ModeState()
    state.apply(Event.REQUEST, ARMED_WITH, Mode.OFFBOARD)
    state.apply(Event.SETPOINTS_LOST, ARMED_WITHOUT)
    assert state.apply(Event.REQUEST, ARMED_WITHOUT, Mode.LOITER)
    assert (state.shown, state.intended, state.in_failsafe) == (Mode.LOITER, Mode.LOITER, False)


@pytest.mark.parametrize("row", TRANSITIONS, ids=lambda row: f"{row.event}-{row.target}")
def test_every_row_can_happen_and_no_earlier_one_hides_it(row: Transition):
    source = row.sources[0] if row.sources else Mode.LOITER
    conditions = {Guard.DISARMED: DISARMED}.get(row.guard, ARMED_WITH)
    assert find_transition(source, row.event, conditions, row.target) is row


def test_the_diagram_shows_every_row():
    diagram = mode_diagram()
    assert diagram.startswith("stateDiagram-v2\n    [*] --> LOITER\n")
    arrows = sum(len(row.sources or (None,)) for row in TRANSITIONS)
    assert diagram.count("-->") == 1 + arrows
    assert "    OFFBOARD --> OFFBOARD_LOST: setpoints stopped [armed]\n" in diagram
    assert "    LAND --> MODE_BEFORE: disarmed\n" in diagram


@pytest.mark.parametrize(
    ("base", "main", "sub", "mode"),
    [
        (1, 6, 0, Mode.OFFBOARD),
        (1, 4, 0, Mode.MISSION),
        (1, 4, 6, Mode.LAND),
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
