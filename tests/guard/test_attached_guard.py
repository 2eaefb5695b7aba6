"""The guard on a program's own connection: none of the program's setpoints reaches the vehicle while it holds."""

from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as dialect

from bench.fly import commanded
from bench.fly.commanded import HOLD, REPEATED_EVERY_S, SET_MODE
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, OFFBOARD
from companion.flight.core import POLL_INTERVAL_US
from companion.guard.holding import stop
from companion.guard.states import State
from companion.mavlink.moves import SETPOINT_IDS
from companion.mavlink.named import named, packet_from
from companion.mavlink.packet import message_id_of
from companion.messages import LocalPosition
from companion.shell import mavsdk_guard
from companion.shell.mavsdk_guard import GIVING_BACK_US, CollisionGuard
from companion.shell.mavsdk_link import GuardError
from tests.guard.flying import PROGRAM, AttachedFlight, by_name

RUN_CHECKS, STALL_S = 401, 1.6  # more than the silence after which the guard lets go (link.silence_s)


def setpoint(system_id: int = 1) -> bytes:
    message = dialect.MAVLink_set_position_target_local_ned_message(7, system_id, 1, 1, 0xDF8, *[1.0] * 11)
    return message.pack(dialect.MAVLink(None, *PROGRAM))


def holding() -> AttachedFlight:
    air = AttachedFlight()
    air.fly_into_the_wall()
    return air


def test_while_the_guard_holds_its_own_setpoints_carry_the_vehicle_and_none_of_the_programs_reaches_it():
    air = holding()
    air.run_to(State.WATCHING, 10.0)
    air.run_for(2.0)
    taken_s, back_s = (air.event_s("take_over"), air.event_s("given_back"))
    assert back_s - taken_s > 0.5
    assert air.setpoints("program", taken_s + 0.004, back_s + 0.004) == []
    # it went on sending all the while, and was heard before and after
    assert air.guard.kept_out == pytest.approx((back_s - taken_s) / REPEATED_EVERY_S, abs=2)
    assert len(air.setpoints("program", taken_s - 1.0, taken_s)) == pytest.approx(20, abs=1)
    assert len(air.setpoints("program", back_s + 0.1, back_s + 1.1)) == pytest.approx(20, abs=1)
    # it is given back to hold, where the program's setpoints mean nothing
    assert air.mode == AUTO_LOITER and air.kinds().count("detection") == 1
    # Meanwhile the guard's own fly it: first by attitude, at the IMU's rate, then by place, fifty times a second
    attitudes = air.sent_by("guard", "SET_ATTITUDE_TARGET", taken_s, back_s)
    own = air.setpoints("guard", taken_s, back_s)
    assert air.sent_by("guard", "SET_ATTITUDE_TARGET", taken_s, taken_s + 0.005) != []
    leans_s = air.event_s("hand_over") - taken_s
    assert len(attitudes) == pytest.approx(250 * leans_s, rel=0.05)
    assert len(own) == pytest.approx(50 * (back_s - taken_s - leans_s), abs=3)
    assert own[-1].x < 3.7
    # In the program's own OFFBOARD nothing was streamed beforehand, and nothing needed confirming
    assert air.setpoints("guard", taken_s - 1.0, taken_s) == []
    # but that PX4 changes its controllers, with the hit to attitudes and with the hand-over to places
    for at_s in (taken_s, air.event_s("hand_over")):
        assert [message.command for message in air.sent_by("guard", "LONG", at_s - 0.1, at_s + 0.1)] == [RUN_CHECKS]
    assert air.event("confirmed").data["after_ms"] == 0.0
    # Nor are heartbeats and time questions of the guard's beside the program's own
    sent = {message.get_type() for message in air.sent_by("guard")}
    assert "COMMAND_LONG" in sent and not sent & {"HEARTBEAT", "TIMESYNC"}


def test_the_guard_makes_way_for_a_programs_setpoints_before_its_offboard_and_after_they_end():
    """Both streams together would have the vehicle stop and go; the guard's alone would keep it in the OFFBOARD of a
    program that has died."""
    air = AttachedFlight()
    air.take_off()
    assert len(air.setpoints("guard", air.time_s - 1.0)) == pytest.approx(10, abs=1)
    began_s = air.time_s
    ends = air.fly_by(0.0, 0.2)
    air.run_until(lambda: air.mode == OFFBOARD, 1.0)
    air.run_for(0.5)
    assert air.state is State.WATCHING
    ends()
    air.run_until(lambda: air.mode != OFFBOARD, 3.0)
    assert air.setpoints("guard", began_s + 0.1) == []


# --- the gate


def test_the_gate_keeps_out_a_programs_setpoints_for_this_vehicle_and_nothing_else():
    air = holding()
    # Its own it knows by their content, each but once
    own = [packet for sender, packet in air.outgoing if sender == "guard" and message_id_of(packet) in SETPOINT_IDS]
    assert own and not air.guard.lets_pass(setpoint())
    assert [air.guard.lets_pass(own[0]) for _ in range(2)] == [True, False]
    # One that flies another vehicle by the same MAVSDK, and one that commands a mode, has its way
    assert air.guard.lets_pass(setpoint(system_id=2))
    air.set_mode(HOLD)
    air.run_to(State.STOOD_DOWN, 1.0)
    assert air.mode == AUTO_LOITER


@pytest.mark.parametrize("chooses", ["mode", "enable"])
def test_after_a_silence_in_a_recovery_the_program_flies_no_further_until_somebody_chooses(chooses):
    air = holding()
    air.run_for(0.3)
    step = air.vehicle.step
    air.vehicle.step = lambda packets: (step(b""), ())[1]
    air.run_for(1.8)
    air.vehicle.step = step
    air.run_for(4.0)
    assert "the guard has released the vehicle" in air.told("not_back")[0] and len(air.vehicle.truth.hits) == 1
    if chooses == "enable":
        air.guard.core.is_enabled = True
    else:
        air.set_mode(commanded.OFFBOARD)
    air.run_for(0.5)
    assert not air.guard.core.flight.awaits_choice and air.setpoints("program", air.time_s - 0.2) != []


def test_it_is_stopped_where_it_comes_to_rest_by_the_two_metres_a_second_squared_of_the_manual():
    guard = AttachedFlight().guard.core.flight
    guard.vehicle.history.add(LocalPosition(1_000_000, (1.0, 0.0, -2.0), (2.0, 0.0, 0.0)))
    assert stop(guard).position_ned_m == (2.0, 0.0, -2.0)


# --- names and fields


def test_fields_of_another_dialect_make_no_packet_and_no_error():
    assert packet_from("HIGHRES_IMU", (1, 1), b'{"message_id": 105}') == b""
    assert packet_from("HEARTBEAT", (1, 1), b'{"type": null, "custom_mode": null}') == b""
    assert packet_from("NO_SUCH_MESSAGE", (1, 1), b"{}") == b""


# --- when the process stalls, or something around the guard fails


def test_after_a_stall_all_that_has_arrived_is_heard_before_silence_is_judged():
    # Given a guard that holds, and a stall in which the pilot takes the vehicle to the land mode
    air = holding()
    land, packets = dialect.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, 4, 6, 0, 0, 0, 0), []
    for number in range(round(STALL_S * 250)):
        packets += air.vehicle.step(land.pack(dialect.MAVLink(None, 255, 190)) if number == 100 else b"")
    since = len(air.events)
    air.outgoing.clear()
    # When the guard's own thread wakes first, and what arrived is heard one message after the other
    air.take(air.guard.step(b"", air.now_us))
    assert air.guard.next_deadline_us() == air.now_us + POLL_INTERVAL_US, "its thread waits meanwhile"
    for number, packet in enumerate(packets):
        air.take(air.guard.step(by_name(packet), air.now_us + number * POLL_INTERVAL_US // len(packets)))
    # Then nothing has been judged or sent by what was old; then the guard stands down for the pilot, not for a silence
    assert len(air.events) == since and air.outgoing == []
    air.run_for(0.3)
    assert air.state is State.STOOD_DOWN and air.mode == AUTO_LAND
    assert len(air.told("let_go")) == 1 and "took over in AUTO.LAND" in air.told("let_go")[0]


class Linked:
    """MAVSDK's connection, joined to a simulated vehicle."""

    system_id = 1

    def __init__(self, *_: object):
        self.sent: list[bytes] = []

    def send(self, packet):
        self.sent.append(packet)


class Joined:
    """A `CollisionGuard` that holds, without its threads: the test takes its turns, on virtual time."""

    def __init__(self, monkeypatch):
        self.air = holding()
        monkeypatch.setattr(mavsdk_guard, "MavsdkLink", Linked)
        monkeypatch.setattr(mavsdk_guard, "Clock", lambda: SimpleNamespace(now_us=lambda: self.air.now_us))
        monkeypatch.setattr(mavsdk_guard, "TRIED_AGAIN_S", 0.0)
        self.guard = CollisionGuard(None, None)
        self.guard._guard = self.air.guard
        self.link: Any = self.guard._link

    def step(self):
        """One interval of the vehicle's; whether there is to be another turn."""
        goes_on = self.guard._turn()
        sent, self.link.sent = self.link.sent, []
        for packet in self.air.vehicle.step(b"".join(sent)):
            name, fields_json = named(packet)
            assert self.guard._incoming(name, (1, 1), fields_json.encode())
        return goes_on

    def lets_pass(self, packet):
        name, fields_json = named(packet)
        return self.guard._outgoing(name, PROGRAM, fields_json.encode())

    def until_over(self, at_most_us: int) -> int:
        """How long it took, in microseconds."""
        start_us = self.air.now_us
        while self.step():
            assert self.air.now_us - start_us < at_most_us
        return self.air.now_us - start_us


def fails(*_):
    raise ValueError("nobody thought of this")


def test_a_fault_in_a_step_gives_the_vehicle_back(monkeypatch):
    # Given a guard that holds, and a step that fails once
    joined = Joined(monkeypatch)
    works, calls = joined.air.guard.step, []

    def fails_once(*arguments):
        calls.append(arguments)
        return fails() if len(calls) == 1 else works(*arguments)

    monkeypatch.setattr(joined.air.guard, "step", fails_once)
    # When it goes on
    joined.until_over(GIVING_BACK_US)
    # Then the vehicle holds by itself, it is told why, and the program's setpoints pass again
    assert joined.air.mode == AUTO_LOITER and joined.lets_pass(setpoint())
    assert any("nobody thought of this" in event.text for event in joined.guard.events)


def test_a_fault_in_the_gate_lets_no_setpoint_pass_while_the_guard_holds(monkeypatch):
    joined = Joined(monkeypatch)
    monkeypatch.setattr(joined.air.guard, "lets_pass", fails)
    assert not joined.lets_pass(setpoint())
    joined.until_over(GIVING_BACK_US)
    assert joined.air.mode == AUTO_LOITER and joined.lets_pass(setpoint())
    # And what came with the last message is told, also beside a listener that fails
    joined.guard._untold, joined.guard._listeners = ["the last"], [fails, joined.link.sent.append]
    assert not joined.guard._turn() and joined.link.sent == ["the last"]


def test_a_setpoint_that_cannot_be_read_passes_but_while_the_guard_holds_and_is_no_fault(monkeypatch):
    joined = Joined(monkeypatch)
    name, fields_json = "SET_POSITION_TARGET_LOCAL_NED", b'{"type_mask": null}'
    assert packet_from(name, PROGRAM, fields_json) == b""
    assert not joined.guard._outgoing(name, PROGRAM, fields_json)
    assert joined.air.guard.core.stop_reason is None
    joined.air.run_to(State.WATCHING, 10.0)
    assert joined.guard._outgoing(name, PROGRAM, fields_json)


def test_a_fault_that_stays_ends_the_guard_in_time(monkeypatch):
    monkeypatch.setattr(mavsdk_guard, "GIVING_BACK_US", 1_000_000)
    joined = Joined(monkeypatch)
    monkeypatch.setattr(joined.air.guard, "step", fails)
    assert joined.until_over(1_100_000) >= 1_000_000


def test_a_mode_that_mavsdk_asks_for_is_a_choice_also_while_the_guard_holds_and_passes(monkeypatch):
    joined = Joined(monkeypatch)
    joined.air.guard.core.flight.awaits_choice = True
    asks = dialect.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, *commanded.OFFBOARD, 0, 0, 0, 0)
    assert joined.lets_pass(asks.pack(dialect.MAVLink(None, *PROGRAM)))
    assert not joined.air.guard.core.flight.awaits_choice


def test_a_guard_that_was_never_started_has_nothing_to_give_back(monkeypatch):
    joined = Joined(monkeypatch)
    monkeypatch.setattr(joined.link, "release", lambda: joined.link.sent.append("released"), raising=False)
    monkeypatch.setattr(joined.guard._changed, "wait_for", lambda *_: pytest.fail("it waits"))
    joined.guard.stop()
    assert joined.link.sent == ["released"]


def test_a_guard_is_started_once(monkeypatch):
    joined = Joined(monkeypatch)
    joined.guard._thread = SimpleNamespace(ident=1)
    with pytest.raises(GuardError, match="started before"):
        joined.guard.start()
