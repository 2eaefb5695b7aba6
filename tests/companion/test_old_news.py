"""The pilot takes over while nothing is heard, at any instant, or seems to: first it is learnt who has the vehicle."""

import pytest

from bench.fly.packets import made
from bench.fly.virtual_time import INTERVAL_US
from tests.companion.fake_vehicle import LOITER, OFFBOARD, POSCTL, FakeVehicle, flight, flying_in
from tests.companion.test_companion_authority import ON_SETPOINTS, assert_silent_from_now
from tests.flying import Flight

SET_MODE = 176


def modes_asked(f: Flight) -> int:
    return f.vehicle.counts.get(SET_MODE, 0)


def stalled(f: Flight, seconds: float, meanwhile) -> bytes:
    """The companion does not run; what the vehicle sends waits."""
    waiting = b""
    for number in range(round(seconds * 1e6 / INTERVAL_US)):
        if number == 50:
            meanwhile()
        f.now_us += INTERVAL_US
        waiting += f.vehicle.step(f.pending)
        f.pending = b""
    return waiting


@pytest.mark.parametrize("state", ON_SETPOINTS)
@pytest.mark.parametrize("stall_s", [1.2, 2.5])
def test_a_pilot_who_took_over_while_the_process_stalled_keeps_the_vehicle(state, stall_s):
    f = flying_in(state)
    asked, since = modes_asked(f), f.now_us

    waiting = stalled(f, stall_s, lambda: f.vehicle.pilot_takes(POSCTL))
    # The oldest of it comes first: in it the companion still flies.
    f.hear(waiting[:200])
    f.hear(waiting[200:])
    f.run_to("aborted", 0.3)

    assert f.vehicle.mode == POSCTL and modes_asked(f) == asked
    assert f.setpoints_since(since) == []
    assert_silent_from_now(f)


def test_after_a_stall_in_which_nothing_happened_the_flight_goes_on_with_the_next_report():
    f = flying_in("holding")
    since = f.now_us
    f.hear(stalled(f, 1.05, lambda: None))
    assert f.setpoints_since(since) == []
    f.run_for(0.12)
    assert f.setpoints_since(since) and f.state == "holding"


@pytest.mark.parametrize("state", ON_SETPOINTS)
def test_a_pilot_who_took_over_while_the_link_was_cut_keeps_the_vehicle(state):
    f = flying_in(state)
    asked = modes_asked(f)
    f.vehicle.silent = f.vehicle.deaf = True
    f.run_for(0.5)
    f.vehicle.pilot_takes(POSCTL)
    f.run_for(2.5)
    since = f.now_us

    f.vehicle.silent = f.vehicle.deaf = False
    f.run_for(3.0)

    assert f.vehicle.mode == POSCTL and modes_asked(f) == asked
    assert f.setpoints_since(since) == []
    assert f.companion.finished


def test_a_cut_link_that_comes_back_in_the_companions_mode_is_handed_over():
    f = flying_in("mission")
    f.vehicle.silent = f.vehicle.deaf = True
    f.run_for(3.0)
    assert f.vehicle.mode == OFFBOARD
    f.vehicle.silent = f.vehicle.deaf = False
    f.run_to_end(1.5)
    assert f.vehicle.mode == LOITER


@pytest.mark.parametrize("state", ON_SETPOINTS)
def test_a_takeover_at_any_instant_stops_the_setpoints_with_the_report_that_shows_it(state):
    """All of a recovery, half a second of the others: ahead of, with and behind every stream and setpoint."""
    flown, tried = flying_in(state), 0
    while flown.state == state and (state == "recovering" or tried < 14):
        tried += 1
        f = flown.copy()
        f.vehicle.pilot_takes(POSCTL)
        asked = modes_asked(f)
        f.step()
        # CURRENT_MODE or HEARTBEAT, whichever comes first
        f.run_until(lambda f=f: f.vehicle.ticks % 25 == 2 or f.vehicle.ticks % 250 == 4, 0.2)
        before_report_us = f.now_us - INTERVAL_US
        f.run_for(0.5)
        assert f.setpoints_since(before_report_us) == [], tried
        assert f.state == "aborted" and f.vehicle.mode == POSCTL and modes_asked(f) == asked
        # The streams' periods are 5, 25, 50 and 250 intervals: 9 has no part in common with any.
        flown.run_for(9 * INTERVAL_US * 1e-6)
    assert tried >= 10


def heartbeat(mode: int, armed: bool, system: int = 1) -> bytes:
    of_a_quadrotor = {"type": 2, "autopilot": 12, "system_status": 4}
    return made("HEARTBEAT", {**of_a_quadrotor, "base_mode": 0x80 * armed, "custom_mode": mode}, (system, 1))


@pytest.mark.parametrize("state", ON_SETPOINTS)
@pytest.mark.parametrize("forged", [heartbeat(OFFBOARD, False), heartbeat(POSCTL, True), heartbeat(POSCTL, False)])
def test_one_forged_heartbeat_pauses_the_setpoints_and_ends_nothing(state, forged):
    f = flying_in(state)
    if state == "takeoff":
        f.run_for(0.2)  # until EXTENDED_SYS_STATE has said that it flies
    since = f.now_us

    f.hear(forged)
    assert f.setpoints_since(since) == []
    f.run_for(0.3)

    assert f.state != "aborted"
    assert f.setpoints_since(since), "on again with the vehicle's own next reports"
    assert [event.kind for event in f.events if "conflicting" in event.text] == ["implausible"]


@pytest.mark.parametrize("answers", [[], [0]])
def test_a_hand_over_that_nobody_takes_ends_its_setpoints_in_bounded_time(answers):
    """A vehicle that accepts and never obeys is asked for twelve seconds; PX4's own failsafe is not kept from it."""
    f = flying_in("mission")
    f.vehicle.obey, f.vehicle.ack = lambda command, count: False, lambda command, count: answers
    f.companion.stop("Ctrl-C")
    f.run_for(5.1)
    since = f.now_us
    f.run_for(12.0)
    assert f.setpoints_since(since) == [] and f.companion.finished


def test_a_mode_that_a_person_chose_just_before_ctrl_c_is_not_overruled():
    """Its report is not yet there; the companion waits for it before it asks."""
    f = flying_in("mission")
    f.run_until(lambda: f.vehicle.ticks % 25 == 5)
    f.vehicle.pilot_takes(POSCTL)
    f.companion.stop("Ctrl-C")
    f.run_to_end(1.0)
    assert f.vehicle.mode == POSCTL


def test_a_pilot_who_changes_the_mode_while_offboard_is_asked_for_on_the_ground_is_not_asked_again():
    f = flight(FakeVehicle(obey=lambda command, count: command != SET_MODE))
    f.run_until(lambda: modes_asked(f) == 1)
    f.vehicle.pilot_takes(POSCTL)
    f.run_to_end(0.5)
    assert modes_asked(f) == 1


def test_what_is_reported_between_two_steps_is_told_with_the_next_although_nothing_is_heard():
    f = flying_in("mission")
    core = f.companion.core
    core.flight.report(f.now_us, "implausible", "seen by somebody else")
    assert f.now_us < f.companion.next_deadline_us()
    (event,) = f.companion.step(b"", f.now_us).events
    assert event.text == "seen by somebody else"
    # and without anything to tell nothing is stepped
    assert f.companion.step(b"", f.now_us).events == ()
