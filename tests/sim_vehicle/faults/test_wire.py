"""A faulty wire loses, delays, turns and damages as asked, in order, and the same way for the same seed."""

import random
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wire import Wire, split
from sim_vehicle.mavlink.faulty_link import restamped
from sim_vehicle.scene import Scene
from tests.sim_vehicle.vehicle_client import Client

STEP_US = 4000


def frame(number: int) -> bytes:
    return bytes([0xFD, 2, 0, 0, number & 0xFF, 1, 1, 105, 0, 0]) + number.to_bytes(2, "little") + b"\0\0"


def number_in(raw: bytes) -> int:
    return int.from_bytes(raw[10:12], "little")


def carried(**fault: Any) -> tuple[list[tuple[int, bytes]], Wire]:
    """One frame every 4 ms; (time, frame) as they arrive."""
    wire = Wire([WireFault.model_validate({"kind": "wire", "at_s": 0, **fault})], 1)
    arrived = []
    for step in range(20_500):
        frames = [frame(step)] if step < 20_000 else []
        arrived += [(step * STEP_US, raw) for raw in wire.carry(frames, step * STEP_US)]
    return arrived, wire


def delays_s(arrived: list[tuple[int, bytes]]) -> np.ndarray:
    return np.array([time_us / 1e6 - number_in(raw) * STEP_US / 1e6 for time_us, raw in arrived])


@pytest.mark.parametrize("burst_packets", [1.0, 8.0])
def test_as_many_are_lost_as_asked_in_runs_as_long_as_asked(burst_packets: float) -> None:
    arrived, wire = carried(loss=0.2, burst_packets=burst_packets)
    there = np.zeros(20_000, bool)
    there[[number_in(raw) for _, raw in arrived]] = True
    assert 1 - there.mean() == pytest.approx(0.2, abs=0.025)
    assert wire.lost == (~there).sum()
    starts = (~there[1:] & there[:-1]).sum()
    # Chance alone makes runs of 1 / (1 - 0.2).
    assert (~there).sum() / starts == pytest.approx(max(burst_packets, 1.25), rel=0.1)


def test_the_share_that_is_overtaken_is_the_one_asked() -> None:
    arrived, _ = carried(reorder=0.1, reorder_by_s=0.02)
    assert (delays_s(arrived) > 0).mean() == pytest.approx(0.1, abs=0.01)
    numbers = [number_in(raw) for _, raw in arrived]
    assert sorted(numbers) == list(range(20_000)) and numbers != sorted(numbers)


def test_bytes_are_split_where_frames_begin() -> None:
    link, chance = dialect.MAVLink(None, 1, 1), random.Random(1)
    messages = [dialect.MAVLink_heartbeat_message(2, 12, 0, chance.randrange(9999), 4, 3) for _ in range(20)]
    frames = [message.pack(link, force_mavlink1=chance.random() < 0.5) for message in messages]
    assert split(b"".join(frames)) == frames
    assert split(b"".join(frames) + b"\x01\x02") == [*frames, b"\x01\x02"]
    assert split(b"".join(frames)[:-1])[-1] == frames[-1][:-1]


def flown(*faults: dict[str, Any], seconds: float = 3.0) -> Client:
    """Who listens to a standing vehicle."""
    client = Client(scene=Scene.model_validate({"faults": faults}))
    client.run(seconds)
    return client


def stamps(client: Client, name: str, field: str) -> np.ndarray:
    return np.array([getattr(message, field) for message in client.all(name)])


def test_a_clock_that_jumps_shows_in_every_stamp_and_wraps_where_it_is_narrow() -> None:
    heard = flown({"kind": "clock_jump", "at_s": 1.0, "jump_s": 4294966.296 - 1.0})
    wide, narrow = stamps(heard, "HIGHRES_IMU", "time_usec"), stamps(heard, "ATTITUDE", "time_boot_ms")
    assert np.diff(wide).max() == pytest.approx(4294965.3e6, abs=0.05e6)
    # One second after the jump the milliseconds are at their end and begin anew.
    assert narrow.max() > 2**32 - 30 and narrow[-1] < 1100
    assert wide[-1] > 2**32 * 1000


def test_a_battery_that_sags_shows_its_voltage() -> None:
    heard = flown({"kind": "battery_sag", "between_s": [0.5, 1.0], "voltage_share": 0.8}, seconds=4.0)
    millivolts = stamps(heard, "SYS_STATUS", "voltage_battery")
    assert millivolts[-1] / millivolts[0] == pytest.approx(0.8, abs=0.01)


def test_what_has_no_stamp_of_the_vehicles_is_left_alone() -> None:
    link = dialect.MAVLink(None, 1, 1)
    heartbeat = dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(link)
    answer = dialect.MAVLink_ping_message(777, 1, 255, 190).pack(link)
    assert restamped(heartbeat, 10**6) == heartbeat
    assert restamped(answer, 10**6) == answer
    assert restamped(b"\xfd\x01", 10**6) == b"\xfd\x01"
    assert restamped(heartbeat[:-1] + b"\x00", 10**6) == heartbeat[:-1] + b"\x00"
