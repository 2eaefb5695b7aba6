"""The guard beside a pilot, a mission or a program on another link: whole wire, virtual time."""

from dataclasses import replace
from unittest.mock import Mock

import pytest
from pymavlink.dialects.v20 import development as dialect

from bench.fly.commanded import FACE_NORTH_M, LAND, MANUAL_POSITION, OFFBOARD, fly_a_mission
from bench.fly.packets import made
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.guard.states import State
from companion.guard.watching import observe
from companion.link.streams import StreamMonitor
from companion.messages import LandedState
from companion.mission.config import CompanionConfig
from companion.reflex.detection.detector import Phase
from tests.companion.fake_vehicle import FakeVehicle
from tests.flying import Flight
from tests.guard.flying import GuardedFlight as Air

CLEAR_M, STREAM = 0.3, 511


def recovering(**changes) -> Air:
    """In the hands of the guard, after a hit that a pilot flew it into."""
    air = Air(GuardConfig(**changes))
    air.pushed_into_the_wall()
    air.run_to(State.RECOVERING, 1.0)
    return air


def mute(air: Air, *message_ids: int) -> None:
    """Of what the guard sends, these never arrive."""
    steps = air.guard.step

    def muted(received, now_us):
        result = steps(received, now_us)
        return result._replace(sent_frames=tuple(frame for frame in result.sent_frames if frame[7] not in message_ids))

    air.guard.step = muted


def test_a_hit_flown_by_sticks_is_answered_at_once_and_recovered_from_and_the_sticks_are_given_back():
    air, told = recovering(then="previous"), ("take_over", "confirmed", "recovered", "given_back")
    air.run_to(State.WATCHING, 10.0)
    air.run_for(1.0)
    assert tuple(kind for kind in air.kinds() if kind in told) == told
    assert air.mode == "POSCTL"
    # measured in virtual time: command, PX4's two answers, CURRENT_MODE; setpoints have led
    assert air.event("confirmed").data["after_ms"] < 50.0
    # where the recovery ended there is no wall within the clearance
    aimed = [event.data["recovery_setpoint_ned_m"] for event in air.events if "recovery_setpoint_ned_m" in event.data]
    assert aimed[-1][0] < FACE_NORTH_M - CLEAR_M
    assert air.event("recovered").data["settled_after_s"] <= 4.0
    # The first recovery setpoint and the mode left with the datagram that shows the hit: the vehicle's next interval is
    # the first that can hear them
    hit_s = air.event_s("detection")
    sent = {m.get_type() for m in air.sent_by("guard", "", hit_s - 0.001, hit_s + 0.001)}
    assert sent >= {"SET_ATTITUDE_TARGET", "COMMAND_LONG"}


def test_a_mission_is_not_given_back_to_that_would_go_on_into_what_was_hit():
    air = Air(GuardConfig(then="previous"))
    air.take_off()
    fly_a_mission(air)
    air.run_to(State.RECOVERING, 30.0)
    air.run_to(State.WATCHING, 10.0)
    air.run_for(2.0)
    assert air.mode == "AUTO.LOITER" and len(air.told("detection")) == 1
    assert "not given back: AUTO.MISSION goes on into what was hit" in air.told("not_back")[0]


@pytest.mark.parametrize(("max_hits", "mode"), [(1, "AUTO.LOITER"), (2, "POSCTL")])
def test_after_the_most_hits_of_a_flight_the_vehicle_is_given_back_to_hold(max_hits, mode):
    air = recovering(then="previous", max_hits=max_hits)
    # Of one recovery, as of what is touched twice
    hits = air.guard.core.flight.reflex.hits
    hits.insert(0, replace(hits[0]))
    air.run_to(State.WATCHING, 10.0)
    assert air.mode == mode and air.told("not_back") == ["not given back: recovery 1 of at most 1"][max_hits - 1 :]


def pushed_on():
    """A vehicle that has recovered, and whose pilot has not opened the hand since the hit."""
    air = Air(GuardConfig(then="previous"))
    air.pushed_into_the_wall()
    air.forward = 0.3
    air.run_to(State.GIVING_BACK, 10.0)
    return air


def test_sticks_that_push_on_into_what_was_hit_are_waited_for():
    air = pushed_on()
    air.run_for(3.0)
    # Then it is held, and told why, until the stick is released
    assert air.state is State.GIVING_BACK
    assert air.told("not_back") == ["not given back: the sticks push on into what was hit: release them"]
    air.forward = 0.0
    air.run_until(lambda: air.guard.core.flight.command_client.requested_mode is not None, 1.0)
    # A hit just then is recovered from: the change of the mode that follows is the guard's own
    at_us = air.vehicle.time_boot_us
    for time_us in (at_us + 1_000, at_us + 2_000):
        hit = {"time_usec": time_us, "fields_updated": 0x3F, "xacc": -40.0, "zacc": -9.8}
        air.guard_hears(made("HIGHRES_IMU", hit))
    air.run_to(State.WATCHING, 10.0)
    air.run_until(lambda: air.mode == "POSCTL", 1.0)
    assert len(air.told("recovered")) == 2 and air.told("let_go") == []


def test_sticks_that_are_heard_no_more_are_not_waited_for():
    air = pushed_on()
    air.stop_all()
    air.run_until(lambda: air.state is not State.GIVING_BACK, 3.0)
    assert air.mode == "AUTO.LOITER" and air.told("given_back")


@pytest.mark.parametrize(("gives_back", "is_fault"), [(True, True), (True, False), (False, False)])
def test_a_fault_or_a_stop_while_it_recovers_or_gives_back_has_the_vehicle_hold(monkeypatch, gives_back, is_fault):
    air = pushed_on() if gives_back else recovering(then="previous")
    # In AUTO.LOITER PX4 would take the moving stick for a pilot's wish.
    air.run_for(0.7)
    if is_fault:
        monkeypatch.setattr(air.guard.core.handler, "step", Mock(side_effect=ValueError("nobody thought of this")))
    else:
        air.guard.stop("stopped with Ctrl-C")
    air.run_until(lambda: air.guard.finished, 2.0)
    assert air.mode == "AUTO.LOITER" and len(air.told("given_back")) == 1
    assert ("nobody thought of this" if is_fault else "stopped with Ctrl-C") in air.guard.core.flight.reason


# --- whoever takes the vehicle has it


def test_a_pilot_who_chooses_a_mode_while_the_guard_holds_has_the_vehicle_at_once():
    air = recovering()
    air.run_for(0.2)
    air.set_mode(MANUAL_POSITION)
    air.run_until(lambda: air.mode == "POSCTL", 1.0)
    let_go_s = air.time_s
    air.run_for(2.0)
    assert (air.state, air.mode) == (State.STOOD_DOWN, "POSCTL")
    assert air.sent_by("guard", "SET_", let_go_s + 0.005) == air.sent_by("guard", "COMMAND", let_go_s + 0.005) == []
    # another hit is the pilot's own affair, until somebody enables the guard again
    air.guard.core.is_enabled = True
    air.run_for(0.1)
    assert air.state is State.WATCHING


def test_sticks_that_are_moved_before_the_guard_has_seen_its_own_mode_have_the_vehicle_all_the_same():
    # Given a pilot who pulls back 4 ms after the hit, and a link that brings no report of the mode
    air = Air(GuardConfig(then="previous"), {"COM_OF_LOSS_T": 1.0})
    air.flown_by_sticks(0.3)
    air.run_until(lambda: air.state is State.TAKING_OVER, 20.0)
    began_s, air.forward = air.time_s, -0.6
    mute(air, dialect.MAVLINK_MSG_ID_HEARTBEAT, dialect.MAVLINK_MSG_ID_CURRENT_MODE)
    air.run_for(0.15)
    # Then the mode that the guard has asked for is not left without a pilot
    asked = [
        message.param2 for message in air.sent_by("guard", "COMMAND_LONG", began_s - 0.01) if message.command == 176
    ]
    assert asked == [6.0, 3.0] and air.others_last["CURRENT_MODE"].custom_mode == 3 << 16


def test_a_mode_that_a_person_chose_just_before_the_vehicle_is_given_back_is_not_overruled():
    air = recovering()
    air.set_mode(MANUAL_POSITION)
    air.run_for(0.008)
    assert air.mode == "OFFBOARD", "the report that shows it is yet to come"
    air.guard.stop("stopped")
    stopped_s = air.time_s
    air.run_for(1.0)
    assert air.mode == "POSCTL"
    assert [m for m in air.sent_by("guard", "COMMAND_LONG", stopped_s) if m.command == 176] == []


def test_the_next_flight_is_guarded_again_and_its_hits_are_counted_anew():
    air = Air()
    air.pushed_into_the_wall()
    air.run_for(0.8)
    air.set_mode(LAND)
    air.run_to(State.STOOD_DOWN, 1.0)
    assert air.guard.core.flight.hits
    air.run_to(State.STANDING_BY, 30.0)
    assert air.guard.status().armed is False and air.guard.core.flight.hits == []


# --- when it does not go as asked


def test_a_vehicle_that_refuses_offboard_is_asked_to_hold():
    """No setpoint arrives before the hit, so PX4 does not take OFFBOARD."""
    air = Air(GuardConfig(confirm_within_s=0.3))
    mute(air, dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET, dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED)
    air.pushed_into_the_wall()
    air.run_to(State.WATCHING, 5.0)
    assert "OFFBOARD" in air.told("refused")[0] and air.mode == "AUTO.LOITER"


def test_a_position_that_ends_while_the_guard_holds_has_the_vehicle_given_back_to_hold():
    air = recovering(then="previous")
    readers = air.guard._decoder._readers
    air.guard._decoder._readers = {n: reader for n, reader in readers.items() if reader.name != "LOCAL_POSITION_NED"}
    silence_s = CompanionConfig().link.position_silence_s
    assert air.run_to(State.GIVING_BACK, 2.0) == pytest.approx(silence_s, abs=0.1)
    air.run_until(lambda: air.mode == "AUTO.LOITER", 1.0)
    assert "no LOCAL_POSITION_NED" in air.told("link")[0]


@pytest.mark.parametrize(
    "lost", [(), (dialect.MAVLINK_MSG_ID_COMMAND_LONG,)], ids=["taken over", "OFFBOARD never asked"]
)
def test_one_forged_packet_is_no_hit_and_the_mode_before_is_given_back(lost):
    air = Air(GuardConfig(then="previous"))
    air.flown_by_sticks(0.1)
    air.run_for(1.0)
    air.forward = 0.0
    mute(air, *lost)
    when = {"time_usec": air.vehicle.time_boot_us + 2_000, "fields_updated": 0x3F}
    heard = air.guard_hears(made("HIGHRES_IMU", {**when, "xacc": -40.0, "zacc": -9.8}))
    assert air.state is State.TAKING_OVER and [event.kind for event in heard].count("detection") == 1
    assert air.run_to(State.WATCHING, 3.0) < 1.0
    air.run_until(lambda: air.mode == "POSCTL", 1.0)
    assert air.kinds().count("unconfirmed") == 1 and air.guard.core.flight.hits == [] and air.told("refused") == []
    assert air.guard.core.limiter.last is None, "another flies: where the last setpoint was is no place to go to"


def test_one_forged_packet_is_no_hit_while_the_vehicle_waits_to_be_given_back():
    # Given a pilot who pushes on
    air = Air(GuardConfig(then="previous"))
    air.flown_by_sticks(0.3)
    air.run_to(State.GIVING_BACK, 30.0)
    air.run_for(1.0)
    (hit,) = air.guard.core.flight.hits
    when = {"time_usec": air.vehicle.time_boot_us + 2_000, "fields_updated": 0x3F}
    air.guard_hears(made("HIGHRES_IMU", {**when, "yacc": 40.0, "zacc": -9.8}))
    assert len(air.guard.core.flight.hits) == 2
    # Then it is not given back to what hits the same again
    air.run_for(3.0)
    assert air.guard.core.flight.hits == [hit] and air.state is State.GIVING_BACK


# --- a program on another link


def test_beside_a_program_on_another_link_the_guard_tells_of_a_hit_and_sends_nothing():
    air = Air()
    air.take_off()
    air.every(0.05, lambda: air.velocity(1.0))
    air.run_for(0.3)
    air.set_mode(OFFBOARD)
    air.run_until(lambda: air.told("left_alone") != [], 20.0)
    hit_s = air.time_s
    air.run_for(0.5)
    assert air.state is State.WATCHING
    kinds = {m.get_type() for m in air.sent_by("guard", "", hit_s)}
    assert kinds <= {"HEARTBEAT", "STATUSTEXT", "TIMESYNC", "NAMED_VALUE_FLOAT"}
    assert air.guard.core.flight.left_alone == len(air.told("left_alone"))


def test_a_program_elsewhere_is_remembered_though_its_mode_was_not_to_be_guarded():
    air = Air(GuardConfig(modes=["POSCTL", "AUTO.TAKEOFF", "AUTO.LOITER"]))
    air.flown_by_sticks()
    air.every(0.05, lambda: air.velocity(0.0))
    air.run_for(0.3)
    air.set_mode(OFFBOARD)
    air.run_for(3.0)
    assert air.state is State.STANDING_BY
    air.set_mode(MANUAL_POSITION)
    air.forward = 0.3
    air.run_until(lambda: air.told("left_alone") != [], 20.0)
    assert air.told("take_over") == []


def test_a_glance_of_offboard_leaves_a_pilot_guarded():
    air = Air()
    air.flown_by_sticks()
    air.run_for(1.0)
    air.set_mode(OFFBOARD)
    air.run_for(0.4)
    air.set_mode(MANUAL_POSITION)
    air.run_for(2.0)
    air.forward = 0.3
    air.run_to(State.TAKING_OVER, 20.0)


def test_a_program_that_begins_to_send_setpoints_in_a_recovery_does_not_end_it():
    air = recovering()
    # When it asks for a way along the wall, on a link of its own
    air.every(0.05, lambda: air.velocity(0.0, 0.25))
    # Then the vehicle rests all the same, and is given back to hold, where nobody's setpoints count
    air.run_to(State.WATCHING, 10.0)
    assert air.told("recovered") != [] and air.told("let_go") == [] and air.mode == "AUTO.LOITER"


# --- when it is not to act


def test_a_failsafe_that_flies_is_not_taken_over_from():
    """AUTO.RTL may be guarded; while a failsafe has chosen it, the vehicle's own judgement goes first."""
    air = Air(parameters={"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 5.0})
    air.take_off()
    air.stop_all()
    air.run_until(lambda: air.mode == "AUTO.RTL", 15.0)
    air.run_for(1.2)
    assert air.state is State.STANDING_BY and "standing by: a failsafe flies" in air.told("standing_by")


def test_a_report_of_the_ground_moves_heights_and_fence_only_while_somebody_else_flies():
    air = Air()
    air.take_off()
    guard = air.guard.core.flight
    origin, here = guard.origin_ned_m, guard.vehicle.history.latest.position_ned_m
    guard.vehicle.landed, guard.expected_mode = LandedState.ON_GROUND, 1
    observe(guard, (), air.guard.core.now_us)
    assert guard.origin_ned_m == origin
    guard.expected_mode = None
    observe(guard, (), air.guard.core.now_us)
    assert guard.origin_ned_m == here


# --- a slow link: 200 ms each way


def test_a_guard_does_not_begin_at_the_end_of_a_slow_link():
    air = Air(faults=[{"kind": "wire", "delay_s": 0.2, "at_s": 0}])
    air.run_until(lambda: air.guard.finished, 30.0)
    assert air.guard.core.flight.reason.startswith(
        "the round trip to the vehicle takes 404 ms and at most 100 ms are allowed"
    )


def test_a_guard_on_the_ground_does_not_go_in_while_the_link_is_slow():
    # Given a guard that stands by, and a link that became slow
    air = Air(faults=[{"kind": "wire", "delay_s": 0.2, "between_s": [8, 26]}])
    air.run_to(State.STANDING_BY, 8.0)
    air.run_until(lambda: air.time_s > 14.0, 20.0)
    # When the vehicle takes off
    for command in ((400, 1), (22,)):
        air.command(*command)
        air.run_for(3.0)
    # Then the guard says why it stands by, and watches when the link is quick again
    air.run_for(5.0)
    assert air.state is State.STANDING_BY
    assert air.told("standing_by")[-1] == "standing by: the round trip to the vehicle takes too long"
    air.run_to(State.WATCHING, 40.0)
    assert air.time_s > 26.0


# --- a vehicle that is restarted on the ground


def test_a_vehicle_that_restarts_between_flights_is_asked_for_its_streams_again():
    # Given a guard that stands by; the last thing it saw was a contact, in which the vehicle lost its power
    f = Flight(Guard(GuardConfig()), FakeVehicle())
    f.run_to("standing by", 10.0)
    asked, reflex = dict(f.vehicle.counts), f.companion.core.reflex
    reflex.monitor.state = replace(reflex.monitor.state, phase=Phase.CONTACT, last_loud_boot_us=10**12)
    known_s, reflex.loss_s = reflex.loss_s, 99.0
    # When the vehicle is restarted, and its clock begins anew
    f.vehicle.silent = True
    f.run_for(2.0)
    f.vehicle.silent, f.vehicle.time_us = False, 0
    f.run_to("connecting", 8.0)
    assert f.told("link") == ["the vehicle was silent: its streams are asked for again"]
    # Then it is asked again, and its detector begins anew
    f.run_to("standing by", 30.0)
    assert f.kinds().count("streams") == 2 and f.vehicle.counts[STREAM] == 2 * asked[STREAM]
    assert reflex.monitor.state.last_loud_boot_us == 0 and reflex.loss_s == known_s


def test_a_guard_that_waits_begins_where_nobody_is_or_a_vehicle_that_tells_too_little():
    # Given a vehicle that is heard after a minute, and a computer that was up before it
    air = Air(GuardConfig.model_validate({"companion": {"link": {"wait": True}}}))
    for second in range(60):
        air.guard.step(b"", air.now_us + (second - 60) * 1_000_000)
    core = air.guard.core
    assert not air.guard.finished
    # And whose streams are too slow by now
    core.flight.streams.streams = tuple(replace(one, min_hz=1000.0) for one in core.flight.streams.streams)
    air.run_for(12.0)
    assert air.state is State.CONNECTING
    assert [text.partition(":")[0] for text in air.told("link")] == ["not guarded by now"]
    # Then it stands by once they are
    core.flight.streams.streams = StreamMonitor(core.flight.mission.companion.streams).streams
    air.run_to(State.STANDING_BY, 10.0)
