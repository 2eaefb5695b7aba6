"""What is really received when a rate is asked for: PX4's rule on 4 ms samples."""

from itertools import pairwise

import pytest

from sim_vehicle.mavlink.streams import streams as module
from tests.sim_vehicle.vehicle_client import SET_INTERVAL, SET_MODE, Client

NUMBERS = {"HIGHRES_IMU": 105, "ATTITUDE_QUATERNION": 31, "ODOMETRY": 331, "LOCAL_POSITION_NED": 32}
ACCEPTED, FAILED = 0, 4


def asked(message_id: int, interval_us: float) -> tuple[Client, list[int]]:
    """A vehicle that stands still and was asked for a message a second ago, and its answer."""
    client = Client()
    client.command(SET_INTERVAL, message_id, interval_us)
    client.run(1.0)
    return client, client.results(SET_INTERVAL)


def gaps_ms(client: Client, kind: str) -> list[int]:
    times_s = [time_s for time_s, message in client.received if message.get_type() == kind]
    return [round(1e3 * (b - a)) for a, b in pairwise(times_s)]


@pytest.fixture
def on_time(monkeypatch):
    """No loop of the link comes too late."""
    monkeypatch.setattr(module, "MISSED_LOOPS_SHARE", 0.0)


@pytest.mark.parametrize(
    ("kind", "asked_hz", "received_hz", "gaps"),
    [
        ("HIGHRES_IMU", 250, 250, {4}),
        ("HIGHRES_IMU", 200, 125, {8}),
        ("HIGHRES_IMU", 100, 100, {8, 12}),
        ("HIGHRES_IMU", 50, 50, {20}),
        ("ATTITUDE_QUATERNION", 250, 250, {4}),
        ("ODOMETRY", 100, 100, {8, 12}),
        ("ODOMETRY", 250, 125, {8}),
        ("LOCAL_POSITION_NED", 250, 125, {8}),
        ("LOCAL_POSITION_NED", 50, 50, {20}),
    ],
)
def test_asked_and_received(on_time, kind, asked_hz, received_hz, gaps):
    client, _ = asked(NUMBERS[kind], 1e6 / asked_hz)
    assert client.rate_hz(kind, 8.0) == pytest.approx(received_hz, rel=0.005)
    assert set(gaps_ms(client, kind)) == gaps


def test_minus_one_stops_and_zero_restores():
    client, _ = asked(105, -1)
    assert client.rate_hz("HIGHRES_IMU", 2.0) == 0
    client.command(SET_INTERVAL, 105, 0)
    assert client.rate_hz("HIGHRES_IMU", 5.0) == pytest.approx(50, rel=0.02)
    # What is not streamed by default is stopped by 0
    client, _ = asked(148, 500_000)
    assert client.rate_hz("AUTOPILOT_VERSION", 5.0) == pytest.approx(2, abs=0.2)
    client.command(SET_INTERVAL, 148, 0)
    client.run(0.1)
    assert client.rate_hz("AUTOPILOT_VERSION", 2.0) == 0


def test_current_mode_comes_on_a_change_and_twice_a_second_at_most_otherwise():
    # Given CURRENT_MODE asked for at 50 Hz
    client, _ = asked(436, 20_000)
    assert client.rate_hz("CURRENT_MODE", 10.0) == pytest.approx(2.0, abs=0.1)
    # When the mode changes
    client.forget()
    client.command(SET_MODE, 1, 6)
    client.run(0.02)
    # Then it says so at once
    (told,) = client.all("CURRENT_MODE")
    assert told.custom_mode == told.intended_custom_mode == 0x00060000
