"""The guard's rules: whoever takes the vehicle has it, no state is a dead end, and who flies may mean to go down."""

import pytest

from companion.autopilot.interface import Pilot
from companion.autopilot.px4.firmware import PX4
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, AUTO_PRECLAND, OFFBOARD, POSCTL
from companion.guard.config import GuardConfig
from companion.guard.machine import GuardCore, has_moved
from companion.guard.states import HOLDING, TABLE, State, Trigger
from companion.guard.watching import goes_down, observe
from companion.messages import CurrentMode, Heartbeat, LandedState, PositionTarget, Sticks
from companion.motion.config import SAME_M_S


@pytest.mark.parametrize("state", [state for state in State if state in HOLDING])
def test_while_the_guard_holds_whoever_takes_the_vehicle_has_it_and_every_failure_gives_it_back(state):
    assert TABLE[state].get(Trigger.CONTROL_LOST) is State.STOOD_DOWN
    assert TABLE[state].get(Trigger.DISARMED) is State.STANDING_BY
    assert TABLE[state].get(Trigger.STOPPED) is State.GIVING_BACK
    assert TABLE[state].get(Trigger.POSITION_SILENT, state) is State.GIVING_BACK


def test_a_crash_is_told_wherever_hits_are_answered_and_ends_with_a_disarm_or_a_take_off():
    assert {state for state in State if Trigger.CRASHED in TABLE[state]} == {*HOLDING, State.WATCHING}
    ends = {trigger for trigger, state in TABLE[State.CRASHED].items() if state is State.STANDING_BY}
    assert ends == {Trigger.DISARMED, Trigger.FLIES_AGAIN} and State.CRASHED not in HOLDING


def test_a_hit_is_answered_where_the_guard_watches_and_never_takes_the_vehicle_back():
    answered = {state for state in State if TABLE[state].get(Trigger.HIT) in HOLDING}
    assert answered == {State.WATCHING, State.TAKING_OVER, State.RECOVERING, State.GIVING_BACK}
    assert TABLE[State.STOOD_DOWN].get(Trigger.ENABLED) is State.STANDING_BY


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
    assert has_moved(Sticks(before), Sticks(now), PX4.stick_override) is counts


SECOND = 1_000_000


def test_a_vehicle_that_is_met_anew_is_what_it_was_and_a_wreck_or_a_fault_does_not_stay_for_ever():
    core, ardupilot = GuardCore(GuardConfig(between=("udpin://:14540",))), Heartbeat(1, 1, 2, 3, False, 5, 3)
    for now_us, heard in ((SECOND, [ardupilot]), (3 * SECOND, []), (3 * SECOND + 1, [ardupilot])):
        core.advance(heard, now_us)
    assert core.reflex.monitor.estimator.hides_clipping and not core.flight.was_met and not core.handler.is_told
    core.state, core.flight.is_wreck, core.flight.fault = State.CRASHED, True, "of the guard's"
    core.advance((), 4 * SECOND)
    assert core.state is State.STANDING_BY and not core.flight.is_wreck
    core.advance((), 5 * SECOND)
    assert core.handler.finished
    core.state, core.handler, core.flight.fault = State.ENDED, core.handlers[State.WATCHING](core.flight, 0), ""
    core.handler.step = lambda *_: 1 / 0
    core.advance((), 6 * SECOND)
    assert core.handler.finished


ALTCTL, STABILIZED, MANUAL, ACRO = 2 << 16, 7 << 16, 1 << 16, 5 << 16


def test_a_mode_that_the_vehicle_is_about_to_be_in_says_who_flies_it():
    guard = GuardCore(GuardConfig()).flight
    guard.vehicle.count_mode(CurrentMode(MANUAL, None))
    guard.ask_for_mode(PX4.setpoints)
    guard.count_asked_mode()
    assert (guard.vehicle.custom_mode, guard.vehicle.pilot) == (PX4.setpoints, Pilot.SETPOINTS)


def is_meant(mode, *samples, now_us=0, landed=LandedState.IN_AIR):
    guard = GuardCore(GuardConfig()).flight
    guard.vehicle.mode, guard.vehicle.landed = CurrentMode(mode, None), landed
    guard.vehicle.pilot = PX4.mode(mode).pilot
    observe(guard, samples, 0)
    return goes_down(guard, now_us)


def down(speed_m_s):
    return PositionTarget((0.0, 0.0, -1.0), speed_m_s)


def throttle(deflection):
    return Sticks((0.0, 0.0, deflection, 0.0))


@pytest.mark.parametrize(
    ("mode", "samples", "is_so"),
    [
        # A landing mode, and a hand on the thrust
        *((mode, (), True) for mode in (AUTO_LAND, AUTO_PRECLAND, STABILIZED, MANUAL, ACRO)),
        # A pilot of whom nothing was ever heard may mean it
        *((mode, (), True) for mode in (ALTCTL, POSCTL)),
        (AUTO_LOITER, (), False),
        # A setpoint that sinks
        (OFFBOARD, (down(1.1 * SAME_M_S),), True),
        (OFFBOARD, (down(SAME_M_S),), False),
        (POSCTL, (down(None),), False),
        (AUTO_LOITER, (down(2.0), down(0.0)), False),
        # A throttle below its middle, where sticks ask for velocities
        (POSCTL, (throttle(-1.5 * PX4.stick_deadzone),), True),
        (ALTCTL, (throttle(-0.9 * PX4.stick_deadzone),), False),
        (AUTO_LOITER, (throttle(-1.0),), False),
    ],
)
def test_whoever_flies_means_what_lets_the_vehicle_down(mode, samples, is_so):
    assert is_meant(mode, *samples) is is_so


def test_a_setpoint_counts_while_it_is_renewed_and_a_vehicle_that_says_it_lands_is_meant_to():
    # PX4 keeps a setpoint for COM_OF_LOSS_T, 1 s
    assert is_meant(OFFBOARD, down(2.0), now_us=SECOND - 1) and not is_meant(OFFBOARD, down(2.0), now_us=SECOND)
    assert is_meant(AUTO_LOITER, landed=LandedState.LANDING)
