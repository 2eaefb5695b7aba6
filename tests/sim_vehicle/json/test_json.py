"""Lockstep with ArduPilot's SITL as the SITL meets it: what it sends and gets, recorded of Copter 4.8-dev."""

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise

import pytest

from companion.autopilot.ardupilot.setup import judge_parameters
from companion.autopilot.setup import Setup, Verdict
from companion.reflex.config import EstimateConfig
from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import AirframeError, VehicleEnded
from sim_vehicle.json.messages import Pulses, pulses_from
from sim_vehicle.json.parameters import ardupilot_parameters
from sim_vehicle.json.vehicle import JsonVehicle
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.scene import Scene
from sim_vehicle.shell import json_udp
from sim_vehicle.shell.json_udp import ArduPilotVehicle
from tests.clients.simulator import free_port

FOLDABLE = load_built_in("foldable")
FULL, STOPPED = 2000, 1000


def packet(count: int, *widths_us: int, magic: int = 18_458) -> bytes:
    return struct.pack("<HHI16H", magic, 1000, count, *widths_us, *(0,) * (16 - len(widths_us)))


def told(line: bytes) -> dict:
    assert line.startswith(b"\n") and line.endswith(b"\n")
    return json.loads(line)


def test_pulses_become_shares_of_the_motors_thrust_and_packets_of_others_are_none() -> None:
    # The last: an output that does not run yet
    pulses = pulses_from(packet(7, STOPPED, 1250, FULL, 2100, 0))
    assert pulses is not None
    assert pulses.count == 7
    assert pulses.motor_fractions(5) == (0.0, 0.25, 1.0, 1.0, 0.0)
    assert [pulses_from(stranger) for stranger in (b"", packet(1)[:-1], packet(1, magic=1))] == [None] * 3


def test_a_vehicle_that_stands_tells_of_gravity_and_of_each_millisecond() -> None:
    vehicle = JsonVehicle(FOLDABLE, Scene(), 1)
    states = [told(vehicle.answer(Pulses(count, (STOPPED,) * 4))) for count in range(200)]
    # Whole microseconds, none of which is lost where they are cut.
    steps = [round(1e6 * (b["timestamp"] - a["timestamp"]), 3) for a, b in pairwise(states)]
    assert {int(step) for step in steps} == {1000}
    forces = [state["imu"]["accel_body"][2] for state in states[-100:]]
    assert sum(forces) / 100 == pytest.approx(-GRAVITY_M_S2, abs=0.3)
    assert states[-1]["quaternion"] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-3)


def test_full_thrust_lifts_by_what_the_motors_have_over_the_weight() -> None:
    vehicle = JsonVehicle(FOLDABLE, Scene(), 1)
    states = [told(vehicle.answer(Pulses(count, (FULL,) * 4))) for count in range(201)]
    lifts_m_s2 = GRAVITY_M_S2 * (1.0 / FOLDABLE.hover_fraction - 1.0)
    # Once the motors are up, and before drag counts.
    climbed_m_s = states[100]["velocity"][2] - states[200]["velocity"][2]
    assert climbed_m_s == pytest.approx(0.1 * lifts_m_s2, rel=0.1)


def test_keys_come_in_the_order_in_which_ardupilot_looks_for_their_letters() -> None:
    line = JsonVehicle(FOLDABLE, Scene(), 1).answer(Pulses(1, (STOPPED,) * 4)).decode()
    keys = ("timestamp", "imu", "gyro", "accel_body", "position", "quaternion", "velocity")
    assert sorted(keys, key=line.index) == list(keys)
    assert [line.count(key) for key in keys] == [1] * len(keys)


def test_motors_in_another_order_are_refused() -> None:
    with pytest.raises(AirframeError, match="quad-x"):
        JsonVehicle(load_built_in("hexa"), Scene(), 1)


def test_a_unit_of_roll_turns_as_fast_as_the_gains_assume() -> None:
    """A roll command c moves each motor of a quad-x by c / 2 of its thrust."""
    values = {parameter.name: parameter.value for parameter in ardupilot_parameters(FOLDABLE)}
    vehicle, hover, part = JsonVehicle(FOLDABLE, Scene(), 1), 0.9, 0.02
    rates = []
    for count in range(500):
        offset = part / 2 * (count >= 400)
        shares = (hover - offset, hover + offset, hover + offset, hover - offset)
        state = told(vehicle.answer(Pulses(count, tuple(round(1000 + 1000 * share) for share in shares))))
        rates.append(state["imu"]["gyro"][0])
    turned_rad_s = sum(rates[490:]) / 10 - sum(rates[470:480]) / 10
    per_unit = turned_rad_s / 0.02 / part
    loop_per_s = 2 * FOLDABLE.control.attitude_damping * FOLDABLE.control.attitude_frequency_rad_s
    assert values["ATC_RAT_RLL_P"] * per_unit == pytest.approx(loop_per_s, rel=0.2)


@pytest.mark.parametrize("airframe", ["foldable", "rigid", "racer"])
def test_the_file_has_what_preflight_asks_for(airframe: str) -> None:
    told = {parameter.name: parameter.value for parameter in ardupilot_parameters(load_built_in(airframe))}
    setup = Setup(told, None, "quadrotor", EstimateConfig(), 250.0, 5.0, "")
    found = {item.item: item.verdict for item in judge_parameters(setup) if item.item in told}
    wanted = {"GUID_TIMEOUT", "GUID_OPTIONS", "ATC_RATE_FF_ENAB", "ATC_RAT_YAW_PDMX", "FENCE_ENABLE", "ATC_ANGLE_MAX"}
    assert wanted <= set(found)
    assert set(found.values()) == {Verdict.GOOD}
    assert told["MOT_THST_HOVER"] == load_built_in(airframe).hover_fraction


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
        self.states.sendto(packet(count, *(STOPPED,) * 16), ("127.0.0.1", self.json_port))

    def state(self) -> dict | None:
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


def test_a_strangers_packet_and_pulses_that_are_said_once_more_move_nothing(sitl: Sitl) -> None:
    sitl.states.sendto(b"nothing of ours", ("127.0.0.1", sitl.json_port))
    for count in (0, 0, 1):
        sitl.sends(count)
    assert sitl.vehicle.step(b"") == []
    assert sitl.vehicle.time_boot_us == 1000
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
