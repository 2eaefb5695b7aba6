"""The guard beside a pilot, a mission or a program on another link: whole wire, virtual time."""

import math

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.guard.config import GuardConfig
from companion.guard.states import State
from tests.guard.flying import ARM, HOLD, LAND, MANUAL_POSITION, MISSION, OFFBOARD, Air

# From the wall's face to the centre of a vehicle that touches it with guards unfolded: 0.24 m.
FACE_NORTH_M = 4.0
CLEAR_M = 0.3


def mission_into_the_wall(air: Air) -> None:
    """One waypoint 8 m north, by the mission protocol."""
    air.send(dialect.MAVLink_mission_count_message(1, 1, 1, 0))
    air.until(lambda: "MISSION_REQUEST_INT" in air.others_last or "MISSION_REQUEST" in air.others_last, 2.0)
    place = air.others_last["GLOBAL_POSITION_INT"]
    north_1e7_deg = round(8.0 / 6_371_000.0 * 1e7 * 180.0 / math.pi)
    air.send(
        dialect.MAVLink_mission_item_int_message(
            *(1, 1, 0, 6, 16, 1, 1, 0.0, 0.0, 0.0, math.nan), place.lat + north_1e7_deg, place.lon, 2.5, 0
        )
    )
    air.until(lambda: "MISSION_ACK" in air.others_last, 2.0)
    assert air.others_last["MISSION_ACK"].type == 0


def pilot(air: Air) -> list[float]:
    """Sticks twenty times a second; the list's only number is the forward one."""
    forward = [0.0]
    air.every(0.05, lambda: air.sticks(forward[0]))
    return forward


def pushed_into_the_wall(air: Air, forward_stick: float = 0.3) -> list[float]:
    stick = pilot(air)
    air.take_off()
    air.mode(MANUAL_POSITION)
    air.until(lambda: air.vehicle_mode() == "POSCTL", 2.0)
    stick[0] = forward_stick
    air.until(lambda: air.state in (State.TAKING_OVER, State.RECOVERING), 20.0)
    return stick


@pytest.fixture(scope="module")
def hit_in_posctl() -> Air:
    air = Air(GuardConfig(then="previous"))
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.until(lambda: air.state is State.WATCHING, 10.0)
    air.run(1.0)
    return air


def test_a_hit_flown_by_sticks_is_recovered_from_and_the_sticks_are_given_back(hit_in_posctl):
    air = hit_in_posctl
    assert [hit.kind for hit in air.events if hit.kind in ("take_over", "confirmed", "recovered", "given_back")] == [
        *("take_over", "confirmed", "recovered", "given_back")
    ]
    assert air.vehicle_mode() == "POSCTL"
    # where the recovery ended there is no wall within the clearance
    aimed = [event.data["recovery_setpoint_ned_m"] for event in air.events if "recovery_setpoint_ned_m" in event.data]
    assert aimed[-1][0] < FACE_NORTH_M - CLEAR_M
    assert not air.event("recovered").data["settled_after_s"] > 4.0


def test_the_guards_state_and_its_detectors_are_there_to_plot_twice_a_second(hit_in_posctl):
    air = hit_in_posctl
    hit_s = 1e-6 * air.event("detection").time_us % 1_600_000_000
    sent = [(at, m) for at, who, m in air.on_wire if who == "guard" and m.get_type() == "NAMED_VALUE_FLOAT"]
    states = [(at, m.value) for at, m in sent if m.name == "rb_state"]
    assert len([at for at, _ in states if hit_s - 2.0 < at <= hit_s]) == pytest.approx(4, abs=1)
    assert {value for _, value in states} >= {float(list(State).index(s)) for s in (State.WATCHING, State.RECOVERING)}
    assert [m.value for _, m in sent if m.name == "rb_hits"][-1] == 1.0
    (v_c, *_) = [
        m for _, who, m in air.on_wire if who == "guard" and m.get_type() == "DEBUG_VECT" and m.name == "rb_v_c"
    ]
    assert v_c.x == pytest.approx(air.event("detection").data["impact_velocity_ned_m_s"][0], abs=1e-3)


def test_the_first_recovery_setpoint_leaves_with_the_datagram_that_shows_the_hit_and_the_mode_with_it(hit_in_posctl):
    air = hit_in_posctl
    hit_s = 1e-6 * air.event("detection").time_us % 1_600_000_000
    after = [(at, who, m.get_type()) for at, who, m in air.on_wire if who == "guard" and at >= hit_s - 0.001]
    # the vehicle's next interval is the first that can hear them
    assert {kind for at, _, kind in after if at <= hit_s + 0.001} >= {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG"}


def test_offboard_is_confirmed_within_the_stated_time_because_setpoints_lead(hit_in_posctl):
    air = hit_in_posctl
    assert air.event("confirmed").data["after_ms"] < 1e3 * GuardConfig().confirm_within_s
    # measured in virtual time: command, PX4's two answers, CURRENT_MODE
    assert air.event("confirmed").data["after_ms"] < 50.0
    hit_s = 1e-6 * air.event("detection").time_us % 1_600_000_000
    lead = [at for at, _ in air.setpoints("guard") if hit_s - 2.0 < at < hit_s]
    assert len(lead) == pytest.approx(2.0 * GuardConfig().lead_hz, abs=2)


def test_a_hit_in_a_mission_is_given_back_to_hold_by_default():
    air = Air()
    air.take_off()
    mission_into_the_wall(air)
    air.mode(MISSION)
    air.until(lambda: air.vehicle_mode() == "AUTO.MISSION", 3.0)
    air.until(lambda: air.state is State.RECOVERING, 30.0)
    air.until(lambda: air.state is State.WATCHING, 10.0)
    assert air.event("take_over").data["mode"] == "AUTO.MISSION"
    air.run(2.0)
    assert air.vehicle_mode() == "AUTO.LOITER"
    assert air.position()[0] < FACE_NORTH_M - CLEAR_M
    assert len(air.told("detection")) == 1


@pytest.mark.slow
def test_a_mission_that_goes_on_into_the_same_wall_ends_in_hold_after_the_hits_allowed():
    air = Air(GuardConfig(then="previous", max_hits=2))
    air.take_off()
    mission_into_the_wall(air)
    air.mode(MISSION)
    air.until(lambda: len(air.told("given_back")) == 2, 60.0)
    assert ["MISSION" in text for text in air.told("given_back")] == [True, False]
    air.run(1.0)
    assert air.vehicle_mode() == "AUTO.LOITER"


def test_a_pilot_who_chooses_a_mode_while_the_guard_holds_has_the_vehicle_at_once():
    air = Air()
    stick = pushed_into_the_wall(air)
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    stick[0] = 0.0
    air.run(0.2)
    air.mode(MANUAL_POSITION)
    air.until(lambda: air.vehicle_mode() == "POSCTL", 1.0)
    let_go_s = air.time_s
    air.run(2.0)
    assert air.state is State.STOOD_DOWN
    assert air.vehicle_mode() == "POSCTL"
    assert air.setpoints("guard", let_go_s + 0.005) == []
    # another hit is the pilot's own affair, until somebody enables the guard again
    air.guard.core.is_enabled = True
    air.run(0.1)
    assert air.state is State.WATCHING


def test_sticks_moved_while_the_guard_holds_give_the_pilot_the_position_mode_though_px4_would_not():
    """COM_RC_OVERRIDE's default: sticks do not end OFFBOARD."""
    air = Air()
    stick = pushed_into_the_wall(air)
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    stick[0] = 0.0
    air.run(0.3)
    assert air.state is State.RECOVERING  # letting go is no taking over
    stick[0] = -0.6
    moved_s = air.time_s
    air.until(lambda: air.vehicle_mode() == "POSCTL", 1.0)
    assert air.time_s - moved_s < 0.15
    assert air.state is State.STOOD_DOWN
    air.run(1.0)
    assert air.vehicle_mode() == "POSCTL"


def test_the_next_flight_is_guarded_again():
    air = Air()
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.run(0.8)
    assert air.state is State.RECOVERING
    air.mode(LAND)
    air.until(lambda: air.state is State.STOOD_DOWN, 1.0)
    assert air.guard.core.flight.hits > 0
    air.until(lambda: air.state is State.STANDING_BY, 30.0)
    assert air.guard.status().armed is False
    # the hits allowed are those of a flight
    assert air.guard.core.flight.hits == 0


def test_a_vehicle_that_refuses_offboard_is_asked_to_hold():
    """No setpoint arrives before the hit, so PX4 does not take OFFBOARD."""
    air = Air(GuardConfig(confirm_within_s=0.3))
    forgetful = air.guard.step

    def without_setpoints(received, now_us):
        result = forgetful(received, now_us)
        kept = tuple(frame for frame in result.sent_frames if frame[7] != 84)
        return type(result)(result.received_frames, kept, result.events)

    air.guard.step = without_setpoints
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.until(lambda: air.state is State.WATCHING, 5.0)
    assert "OFFBOARD" in air.told("refused")[0]
    assert air.vehicle_mode() == "AUTO.LOITER"


def test_a_mode_that_is_not_allowed_is_left_alone_and_nothing_is_streamed_in_it():
    air = Air(GuardConfig(modes=("AUTO.MISSION",)))
    stick = pilot(air)
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
    air.until(air._is_ready, 20.0)
    air.command(ARM, 1)
    air.run(0.5)
    air.command(22)
    air.run(5.0)
    air.mode(MANUAL_POSITION)
    air.run(0.2)
    stick[0] = 0.3
    air.run(8.0)
    assert air.state is State.STANDING_BY
    assert air.told("detection") == []
    assert air.setpoints("guard") == []


def test_told_to_stop_while_it_holds_it_gives_the_vehicle_to_hold_first():
    air = Air(GuardConfig(then="previous"))
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    # In AUTO.LOITER PX4 would take the moving stick for a pilot's wish.
    air.run(0.8)
    assert air.state is State.RECOVERING
    air.guard.stop("stopped with Ctrl-C")
    air.until(lambda: air.guard.finished, 2.0)
    assert air.vehicle_mode() == "AUTO.LOITER"
    assert air.guard.outcome == "stopped with Ctrl-C"


def test_a_link_that_falls_silent_while_the_guard_holds_leaves_the_vehicle_to_its_own_failsafe():
    air = Air()
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    # the guard's ears and mouth are cut off; its clock goes on
    now_us = 1_600_000_000_000_000 + air.vehicle.time_boot_us
    for _ in range(100):
        now_us += 20_000
        air.guard.step(b"", now_us)
    assert air.state is State.STOOD_DOWN


def test_beside_a_program_on_another_link_the_guard_tells_of_a_hit_and_sends_nothing():
    air = Air()
    air.take_off()
    air.every(0.05, lambda: air.velocity(1.0))
    air.run(0.3)
    air.mode(OFFBOARD)
    air.until(lambda: air.told("left_alone") != [], 20.0)
    hit_s = air.time_s
    air.run(0.5)
    assert air.state is State.WATCHING
    kinds = {m.get_type() for at, who, m in air.on_wire if who == "guard" and at >= hit_s}
    assert kinds <= {"HEARTBEAT", "STATUSTEXT", "TIMESYNC", "NAMED_VALUE_FLOAT"}
    assert air.guard.left_alone() == len(air.told("left_alone"))


def test_beside_a_program_on_another_link_the_vehicle_is_led_clear_by_a_command_where_that_is_wanted():
    air = Air(GuardConfig(beside_program="reposition"))
    air.take_off()
    stop = air.every(0.05, lambda: air.velocity(1.0))
    air.run(0.3)
    air.mode(OFFBOARD)
    air.until(lambda: air.vehicle_mode() == "OFFBOARD", 2.0)
    air.until(lambda: air.told("detection") != [], 20.0)
    hit_s = air.time_s
    air.run(0.4)
    assert air.vehicle_mode() == "AUTO.LOITER"
    offboard_asked = [
        m for at, who, m in air.on_wire if who == "guard" and at >= hit_s and m.get_type() == "COMMAND_LONG"
    ]
    assert {(m.param2, m.param3) for m in offboard_asked} <= {HOLD}
    assert air.setpoints("guard", hit_s - 0.5) == []
    # by one command, which a program's setpoints do not undo, it is led away from the wall
    led = [(at, m.command) for at, who, m in air.on_wire if who == "guard" and m.get_type() == "COMMAND_INT"]
    assert [command for _, command in led] == [192]
    # once nothing has pushed for 40 ms, and before the program's setpoints push it into the wall again
    assert 0.03 < led[0][0] - 1e-6 * air.vehicle.truth.hits[0].ended_at_boot_us < 0.1
    air.run(5.0)
    stop()
    assert air.vehicle_mode() == "AUTO.LOITER"
    assert air.position()[0] < FACE_NORTH_M - CLEAR_M
    assert air.position()[2] < -2.0


def test_a_second_stream_that_appears_while_the_guard_holds_is_noticed_and_not_fought():
    air = Air()
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    air.every(0.05, lambda: air.velocity(0.0, 0.5))
    began_s = air.time_s
    air.until(lambda: air.told("crossed") != [], 1.0)
    assert air.time_s - began_s < 0.8
    air.until(lambda: air.vehicle_mode() == "AUTO.LOITER", 1.0)


def test_one_forged_packet_is_no_hit_and_the_mode_before_is_given_back():
    air = Air(GuardConfig(then="previous"))
    stick = pilot(air)
    air.take_off()
    air.mode(MANUAL_POSITION)
    air.until(lambda: air.vehicle_mode() == "POSCTL", 2.0)
    stick[0] = 0.1
    air.run(1.0)
    stick[0] = 0.0
    values = (-40.0, 0.0, -9.8, *[0.0] * 10)
    forged = dialect.MAVLink_highres_imu_message(air.vehicle.time_boot_us + 2_000, *values, 0x3F)
    heard = air.guard_hears(bytes(forged.pack(dialect.MAVLink(None, 1, 1))))
    assert air.state is State.TAKING_OVER and [event.kind for event in heard].count("detection") == 1
    assert air.until(lambda: air.state is State.WATCHING, 3.0) < 1.0
    air.until(lambda: air.vehicle_mode() == "POSCTL", 1.0)
    assert [event.kind for event in air.events].count("unconfirmed") == 1
    assert air.guard.core.flight.hits == 0
