"""Lockstep with ArduPilot's SITL as the SITL meets it: a state for pulses, and no state before MAVLink was heard."""

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import VehicleEnded
from sim_vehicle.json.vehicle import JsonVehicle
from sim_vehicle.scene import Scene
from sim_vehicle.shell import json_udp
from sim_vehicle.shell.json_udp import ArduPilotVehicle
from tests.ports import free_port


@dataclass
class Sitl:
    """Its two sockets, and the vehicle at their other ends."""

    states: socket.socket
    mavlink: socket.socket
    vehicle: ArduPilotVehicle
    json_port: int

    def sends(self, count: int, said: bytes = b"") -> None:
        """MAVLink first, as it leaves before the next pulses do."""
        self.mavlink.sendall(said)
        pulses = struct.pack("<HHI16H", 18_458, 1000, count, *(1000,) * 16)
        self.states.sendto(pulses, ("127.0.0.1", self.json_port))

    def state(self) -> dict | None:
        """What has come; None where nothing has."""
        try:
            return json.loads(self.states.recv(2048))
        except BlockingIOError:
            return None


@pytest.fixture
def sitl(monkeypatch: pytest.MonkeyPatch) -> Iterator[Sitl]:
    with ExitStack() as closed:
        listener = closed.enter_context(socket.create_server(("127.0.0.1", 0)))
        monkeypatch.setattr(json_udp, "MAVLINK_PORT", listener.getsockname()[1])
        monkeypatch.setattr(json_udp, "JSON_PORT", free_port(socket.SOCK_DGRAM))
        body = JsonVehicle(load_built_in("foldable"), Scene(), 1)
        vehicle = closed.enter_context(ArduPilotVehicle(body, 0, lambda: False))
        mavlink = closed.enter_context(listener.accept()[0])
        states = closed.enter_context(socket.socket(type=socket.SOCK_DGRAM))
        states.bind(("127.0.0.1", 0))
        states.setblocking(False)
        mavlink.setblocking(False)
        yield Sitl(states, mavlink, vehicle, json_udp.JSON_PORT)


def test_a_state_is_held_back_until_what_was_said_is_heard_and_answered(sitl: Sitl) -> None:
    sitl.sends(0, b"said at 0")
    assert sitl.state() is None
    assert b"".join(sitl.vehicle.step(b"")) == b"said at 0"
    first = sitl.state()
    sitl.sends(1, b"said at 1")
    assert sitl.state() is None
    assert b"".join(sitl.vehicle.step(b"answer")) == b"said at 1"
    assert sitl.mavlink.recv(64) == b"answer"
    second = sitl.state()
    assert first is not None and second is not None
    assert second["timestamp"] - first["timestamp"] == pytest.approx(0.001, abs=1e-6)
    assert sitl.vehicle.time_boot_us == 2000


def test_a_strangers_packet_moves_nothing(sitl: Sitl) -> None:
    sitl.states.sendto(b"nothing of ours", ("127.0.0.1", sitl.json_port))
    sitl.sends(0)
    assert sitl.vehicle.step(b"") == []
    assert sitl.vehicle.time_boot_us == 1000


def test_pulses_that_are_said_once_more_move_nothing(sitl: Sitl) -> None:
    for count in (0, 0, 1):
        sitl.sends(count)
    sitl.vehicle.step(b"")
    sitl.vehicle.step(b"")
    assert sitl.vehicle.time_boot_us == 2000
    assert [sitl.state() is None for _ in range(3)] == [False, False, True]


def test_boot_goes_on_until_it_can_be_armed(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_udp, "READY_US", 3000)
    for count in range(4):
        sitl.sends(count, b"old")
    sitl.vehicle.start()
    assert sitl.vehicle.time_boot_us == 3000


def test_a_sitl_that_has_gone_ends_the_flight_in_a_sentence(sitl: Sitl) -> None:
    sitl.mavlink.close()
    sitl.vehicle._states.settimeout(0.01)
    with pytest.raises(VehicleEnded, match="ArduPilot's SITL has ended"):
        sitl.vehicle.step(b"")


def test_who_waits_for_a_sitl_can_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_udp, "JSON_PORT", free_port(socket.SOCK_DGRAM))
    monkeypatch.setattr(json_udp, "MAVLINK_PORT", free_port(socket.SOCK_STREAM))
    body = JsonVehicle(load_built_in("foldable"), Scene(), 1)
    stops = iter((False, True))
    with pytest.raises(VehicleEnded, match="stopped before"):
        ArduPilotVehicle(body, 0, lambda: next(stops))
