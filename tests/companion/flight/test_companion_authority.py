"""Who flies: requests, failsafes and the pilot are told apart, at any instant; and the companion never fights."""

import math

import pytest
from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import made
from bench.fly.virtual_time import INTERVAL_US
from tests.companion import fake_vehicle
from tests.companion.fake_vehicle import LAND, LOITER, OFFBOARD, POSCTL, FakeVehicle, flight, flying_in
from tests.flying import Flight

IN_THE_AIR = ["takeoff", "mission", "recovering", "holding", "returning", "landing"]
ON_SETPOINTS = ["takeoff", "mission", "recovering", "holding"]


SET_MODE = 176


def is_asked_to_land(f: Flight) -> bool:
    """By PX4's sub-mode of AUTO."""
    return any(message.command == SET_MODE and message.param3 == 6 for _, message in f.messages("COMMAND_LONG"))


def assert_silent_from_now(f: Flight) -> None:
    """No setpoint and no command for three seconds, well beyond PX4's loss time-out."""
    commands = len(f.vehicle.commands)
    since = f.now_us
    f.run_for(3.0)
    assert f.setpoints_since(since) == []
    assert len(f.vehicle.commands) == commands


@pytest.mark.parametrize("state", IN_THE_AIR)
@pytest.mark.parametrize(
    ("takes", "seen_in", "within_s", "words"),
    [
        (lambda vehicle: vehicle.pilot_takes(POSCTL), "current_mode", 0.2, "the pilot took over in POSCTL"),
        # one for want of setpoints would end by itself within 0.4 s
        (lambda vehicle: vehicle.failsafe_takes(LOITER), "current_mode", 0.6, "a failsafe of the vehicle took over"),
        # HEARTBEAT alone tells it once a second, and tells it twice before it counts
        (lambda vehicle: vehicle.failsafe_takes(LOITER), "heartbeat", 2.5, "a failsafe of the vehicle took over"),
        (lambda vehicle: setattr(vehicle, "armed", False), "heartbeat", 2.1, "disarmed"),
    ],
    ids=["pilot", "failsafe", "failsafe in heartbeats", "disarmed"],
)
def test_whoever_takes_the_vehicle_ends_the_flight_and_is_named(state, takes, seen_in, within_s, words):
    f = flying_in(state)
    f.vehicle.no_current_mode = seen_in == "heartbeat"
    takes(f.vehicle)
    f.run_to("aborted", within_s + 1.8 if state == "landing" else within_s)
    assert f.companion.finished and f.report.outcome == "aborted" and words in f.report.reason
    assert_silent_from_now(f)


def test_a_warning_status_in_offboard_or_for_late_setpoints_ends_no_flight_which_goes_on_from_where_the_vehicle_is():
    f = flying_in("mission")
    f.vehicle.failsafe = True
    for mode, lasts_s in ((OFFBOARD, 0.8), (LOITER, 0.3), (OFFBOARD, 0.1)):
        f.vehicle.mode = mode
        f.run_for(lasts_s)
    _, sent = f.vehicle.setpoints[-1]
    assert f.state == "mission" and [sent.x, sent.y, sent.z] == pytest.approx(f.vehicle.position, abs=0.1)


def test_what_a_failsafe_has_all_but_landed_does_not_take_off_again():
    f = flying_in("takeoff")
    f.vehicle.failsafe_takes(LAND)
    f.run_to("aborted", 0.2)


@pytest.mark.parametrize("before_us", [20_000, 90_000])
def test_a_pilot_who_took_over_just_before_the_landing_is_asked_for_keeps_the_vehicle(before_us):
    f = flying_in("mission")
    landing = f.copy()
    landing.run_until(lambda: is_asked_to_land(landing), 60.0)
    f.run_until(lambda: f.now_us >= landing.now_us - before_us, 60.0)
    f.vehicle.pilot_takes(POSCTL)
    f.run_for(3.0)
    assert f.vehicle.mode == POSCTL and "the pilot took over" in f.report.reason


def test_a_landing_that_was_asked_for_just_before_ctrl_c_is_no_pilot():
    f = flying_in("mission")
    f.run_until(lambda: is_asked_to_land(f), 60.0)
    f.companion.stop("Ctrl-C")
    f.run_to_end()
    assert f.vehicle.mode == LOITER and not any("pilot" in text for text in f.texts())


def test_a_vehicle_that_somebody_else_arms_before_offboard_is_taken_is_left():
    # Given one that refuses the mode twice
    def refuses(command, count):
        return command == SET_MODE and count <= 2

    f = flight(FakeVehicle(ack=lambda *asked: [int(refuses(*asked))], obey=lambda *asked: not refuses(*asked)))
    f.run_to("takeoff")
    f.run_for(0.3)
    f.vehicle.pilot_takes(POSCTL)
    f.vehicle.armed, f.vehicle.landed, f.vehicle.position[2] = True, 2, -3.0
    f.run_for(6.0)
    assert f.vehicle.mode == POSCTL and f.state == "aborted" and not f.told("armed")


def test_px4_leaving_land_mode_once_it_is_down_is_not_a_pilot():
    f = flying_in("landing")
    f.run_until(lambda: f.vehicle.position[2] > -0.05)
    f.vehicle.landed, f.vehicle.target = 1, None
    f.vehicle.mode = OFFBOARD  # still armed: PX4 disarms two seconds after touchdown
    f.run_for(2.5)
    assert f.state == "landing"
    f.vehicle.armed = False
    f.run_to("done", 1.1)


@pytest.mark.parametrize("state", IN_THE_AIR)
@pytest.mark.parametrize(("on_interrupt", "mode"), [("hold", LOITER), ("land", LAND)])
def test_ctrl_c_hands_the_vehicle_over_as_the_mission_says(state, on_interrupt, mode):
    f = flying_in(state, on_interrupt=on_interrupt)
    stopped_at = f.now_us
    f.companion.stop("Ctrl-C")
    report = f.run_to_end(8.0 if state == "recovering" else 2.0)
    assert f.vehicle.mode == mode
    assert f.vehicle.armed
    assert (report.outcome, report.reason) == ("aborted", "Ctrl-C")
    assert f.state == "aborted"
    if state != "landing":
        assert f.setpoints_since(stopped_at), "setpoints go on until the mode is seen to hold"
    assert_silent_from_now(f)


def test_ctrl_c_at_a_wall_waits_until_the_vehicle_is_clear_and_once_more_does_not():
    f = flying_in("recovering")
    f.companion.stop("Ctrl-C")
    f.run_for(0.1)
    assert f.state == "recovering" and f.companion.stop_is_put_off and "stopping" in f.kinds()
    insisting = f.copy()
    f.run_to_end(8.0)
    assert "recovered" in f.kinds() and f.report.reason == "Ctrl-C"
    insisting.companion.stop("Ctrl-C, and once more")
    insisting.run_to_end(2.0)
    assert insisting.vehicle.mode == LOITER and "recovered" not in insisting.kinds()
    assert insisting.report.reason == "Ctrl-C, and once more"


def test_a_mission_that_is_to_end_at_a_wall_ends_once_the_vehicle_is_clear_but_outside_the_fence_at_once():
    aborts = {"outside_fence_by_m": 0.5, "battery_below_percent": 50.0}
    vehicle = FakeVehicle(wall_north_m=3.0, battery_percent=80)
    f = flight(vehicle, items=[fake_vehicle.TAKEOFF, fake_vehicle.INTO_WALL, {"land": {}}], abort_when=aborts)
    f.run_to("recovering")
    outside = f.copy()
    f.vehicle.battery_percent = 40
    f.run_until(lambda: "stopping" in f.kinds(), 1.0)
    f.companion.stop("Ctrl-C, and for the first time")
    f.run_to_end(8.0)
    assert "recovered" in f.kinds() and f.report.reason.startswith("battery at 40 %")
    outside.vehicle.position[1] += 30.0
    outside.run_to_end(2.0)
    assert "recovered" not in outside.kinds() and "outside the fence" in outside.report.reason


@pytest.mark.parametrize("state", ["mission", "recovering"])
def test_a_silence_that_is_shorter_than_the_links_limit_ends_nothing_whatever_is_heard_first(state):
    f = flying_in(state)
    f.vehicle.silent = True
    f.run_for(1.3)
    f.vehicle.silent = False
    f.run_for(0.5)
    assert "aborted" not in f.kinds()


def test_a_time_for_which_no_vehicle_holds_a_setpoint_is_refused():
    f = flying_in("mission")
    loss_s = f.companion.core.reflex.loss_s
    for value in (-0.3, 70.0, 1e9, math.nan):
        f.vehicle.send(mav.MAVLink_param_value_message(b"COM_OF_LOSS_T", value, mav.MAV_PARAM_TYPE_REAL32, 1, 0))
    f.run_for(0.1)
    assert f.companion.core.reflex.loss_s == loss_s


def test_a_vehicle_that_refuses_to_hold_is_asked_to_land():
    """As PX4 does without a global position: ACCEPTED by the receiver, then the commander's refusal."""
    f = flying_in("mission")

    def asks_to_hold() -> bool:
        message = f.vehicle.commands[-1][1]
        return message.command == 176 and int(message.param2) << 16 | int(message.param3) << 24 == LOITER

    f.vehicle.ack = lambda command, count: [0, 1] if asks_to_hold() else [0]
    f.vehicle.obey = lambda command, count: not asks_to_hold()
    f.companion.stop("Ctrl-C")
    f.run_to_end(8.0)
    assert f.vehicle.mode == LAND
    assert [e for e in f.events if "asking it to land" in e.text]
    assert f.report.outcome == "aborted"


def test_a_pilot_who_takes_over_during_the_hand_over_keeps_the_vehicle():
    f = flying_in("mission")
    f.vehicle.deaf = True
    f.companion.stop("Ctrl-C")
    f.run_for(0.2)
    f.vehicle.pilot_takes(POSCTL)
    f.run_to_end(0.2)
    f.vehicle.deaf = False
    f.pending = b""
    f.run_for(3.0)
    assert f.vehicle.mode == POSCTL


def test_ctrl_c_while_arming_on_the_ground_disarms():
    f = flight(FakeVehicle(obey=lambda command, count: command != 400 or count > 1))
    f.run_until(lambda: f.vehicle.counts.get(400) == 1)
    f.vehicle.armed = True  # armed after all, but it has not said so yet
    f.companion.stop("Ctrl-C")
    f.run_to_end(5.0)
    assert not f.vehicle.armed
    assert f.vehicle.mode == LOITER
    assert f.report.outcome == "aborted"


@pytest.mark.parametrize("state", ["connect", "ready"])
def test_ctrl_c_before_the_flight_asks_nothing_of_the_vehicle(state):
    f = flight(confirmed=False)
    f.run_to(state)
    f.companion.stop("Ctrl-C")
    assert f.run_to_end(0.1).outcome == "aborted"
    assert not [m for _, m in f.vehicle.commands if m.command in (176, 400)]


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


def test_a_vehicle_that_has_fallen_silent_is_asked_who_has_it():
    f = flying_in("mission")
    f.vehicle.silent, since_us = True, f.vehicle.time_us
    f.run_for(1.1)
    assert [(m.command, m.param1) for at_us, m in f.vehicle.commands if at_us >= since_us] == [(512, 0)]


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
    assert any("no answer" in text for text in f.told("command")) is (answers == [])


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
