"""The guard on a program's own connection, when the process stalls and when something around the guard fails."""

import json
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.core import POLL_INTERVAL_US
from companion.guard.states import State
from companion.px4_mode import AUTO_LAND, AUTO_LOITER
from companion.shell import mavsdk_guard
from companion.shell.mavsdk_guard import GIVING_BACK_US, CollisionGuard
from tests.guard.attached_air import AttachedAir, fields_of, message_of
from tests.guard.flying import SET_MODE

STALL_S = 1.6  # more than the silence after which the guard lets go (link.silence_s)


def holding() -> AttachedAir:
    air = AttachedAir()
    air.fly_into_the_wall()
    return air


def stalled(air: AttachedAir) -> list[Any]:
    """The process does not run; the pilot asks for the land mode, and what the vehicle sends waits."""
    message = dialect.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, 4, 6, 0, 0, 0, 0)
    packets: list[bytes] = []
    for number in range(round(STALL_S * 250)):
        land = message.pack(dialect.MAVLink(None, 255, 190)) if number == 100 else b""
        packets += air.vehicle.step(land)
    parser = dialect.MAVLink(None)
    return [parser.decode(bytearray(packet)) for packet in packets]


def test_after_a_stall_all_that_has_arrived_is_heard_before_silence_is_judged():
    # Given a guard that holds, and a stall in which the pilot took the vehicle
    air = holding()
    waiting, since = stalled(air), len(air.events)
    air._outgoing.clear()
    # When the guard's own thread wakes first, and what arrived is heard one message after the other
    air.take(air.guard.step((), air.now_us))
    assert air.guard.next_deadline_us() == air.now_us + POLL_INTERVAL_US, "its thread waits meanwhile"
    for number, message in enumerate(waiting):
        heard = json.loads(json.dumps(fields_of(message)))
        now_us = air.now_us + number * POLL_INTERVAL_US // len(waiting)
        air.take(air.guard.hear(message.get_type(), (1, 1), heard, now_us))
    # Then nothing has been judged or sent by what was old; then the guard stands down for the pilot, not for a silence
    assert len(air.events) == since and air._outgoing == []
    air.run(0.3)
    assert air.state is State.STOOD_DOWN and air.vehicle is not None and air.mode == AUTO_LAND
    (let_go,) = [event.text for event in air.events if event.kind == "let_go"]
    assert "took over in AUTO.LAND" in let_go


class Linked:
    """MAVSDK's connection, joined to a simulated vehicle."""

    system_id = 1

    def __init__(self, *_: object):
        self.sent: list[tuple[str, Any]] = []

    def send(self, name, fields):
        self.sent.append((name, json.loads(json.dumps(dict(fields)))))


class Clocked:
    def __init__(self, air):
        self._air = air

    def now_us(self):
        return self._air.now_us


class Joined:
    """A `CollisionGuard` without its threads: the test takes its turns, on virtual time."""

    def __init__(self, monkeypatch, air):
        self.air = air
        monkeypatch.setattr(mavsdk_guard, "MavsdkLink", Linked)
        monkeypatch.setattr(mavsdk_guard, "Clock", lambda: Clocked(air))
        monkeypatch.setattr(mavsdk_guard, "TRIED_AGAIN_S", 0.0)
        self.guard = CollisionGuard(None, None)
        self.guard._guard = air.guard
        self.link: Any = self.guard._link
        self._mavlink, self._parser = dialect.MAVLink(None, 245, 190), dialect.MAVLink(None)

    def step(self):
        """One interval of the vehicle's; whether there is to be another turn."""
        goes_on = self.guard._turn()
        sent, self.link.sent = self.link.sent, []
        packets = b"".join([message_of(name, fields).pack(self._mavlink) for name, fields in sent])
        for packet in self.air.vehicle.step(packets):
            message = self._parser.decode(bytearray(packet))
            name, fields = message.get_type(), json.dumps(fields_of(message)).encode()
            assert self.guard._incoming(name, (1, 1), fields)
        return goes_on


def until_over(joined: Joined, at_most_us: int) -> int:
    """How long it took, in microseconds."""
    start_us = joined.air.now_us
    while joined.step():
        assert joined.air.now_us - start_us < at_most_us
    return joined.air.now_us - start_us


@pytest.mark.parametrize("broken", ["step", "hear"])
def test_a_fault_on_either_thread_gives_the_vehicle_back(monkeypatch, broken):
    # Given a guard that holds, and a step that fails once
    joined = Joined(monkeypatch, holding())
    works, calls = getattr(joined.air.guard, broken), []

    def fails(*arguments):
        calls.append(arguments)
        if len(calls) == 1:
            raise ValueError("nobody thought of this")
        return works(*arguments)

    monkeypatch.setattr(joined.air.guard, broken, fails)
    # When it goes on
    until_over(joined, GIVING_BACK_US)
    # Then the vehicle holds by itself, it is told why, and the program's setpoints pass again
    assert joined.air.mode == AUTO_LOITER
    told = [event.text for event in joined.guard.events]
    assert any("nobody thought of this" in text for text in told)
    assert joined.guard._outgoing("SET_POSITION_TARGET_LOCAL_NED", (245, 190), b"{}")


def test_a_fault_in_the_gate_lets_no_setpoint_pass_while_the_guard_holds(monkeypatch):
    joined = Joined(monkeypatch, holding())

    def fails(*_):
        raise ValueError("of the gate")

    monkeypatch.setattr(joined.air.guard, "lets_pass", fails)
    setpoint = ("SET_POSITION_TARGET_LOCAL_NED", (245, 190), b"{}")
    assert not joined.guard._outgoing(*setpoint)
    until_over(joined, GIVING_BACK_US)
    assert joined.air.mode == AUTO_LOITER and joined.guard._outgoing(*setpoint)


def test_a_fault_that_stays_ends_the_guard_in_time(monkeypatch):
    monkeypatch.setattr(mavsdk_guard, "GIVING_BACK_US", 1_000_000)
    joined = Joined(monkeypatch, holding())

    def fails(*_):
        raise ValueError("for good")

    monkeypatch.setattr(joined.air.guard, "step", fails)
    assert until_over(joined, 1_100_000) >= 1_000_000
