"""What is really received when a rate is asked for: PX4's rule on 4 ms samples."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.line import Line, Outbox
from sim_vehicle.mavlink.streams import streams as module
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.mavlink.streams.streams import Streams, interval_from_request
from sim_vehicle.mavlink.streams.topics import Topics
from sim_vehicle.mavlink.telemetry import Telemetry
from sim_vehicle.mavlink.vibration import VibrationMetrics
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.kinematic_plant import HOVER, Estimate

HEARTBEAT, SYS_STATUS, ATTITUDE, ATTITUDE_QUATERNION, LOCAL_POSITION_NED = 0, 1, 30, 31, 32
ATTITUDE_TARGET, POSITION_TARGET, HIGHRES_IMU, TIMESYNC, AUTOPILOT_VERSION = 83, 85, 105, 111, 148
VIBRATION, MESSAGE_INTERVAL, EXTENDED_SYS_STATE, ODOMETRY, CURRENT_MODE = 241, 244, 245, 331, 436


class Link:
    """The streams of a vehicle that stands still, with the time at which each message was sent."""

    def __init__(self, seed: int = 1) -> None:
        self.sample = Estimate(time_boot_us=4_000)
        self.autopilot = Autopilot(HOVER, self.sample, Parameters())
        telemetry = Telemetry(self.sample, self.sample, self.autopilot, VibrationMetrics(), 1e-4, 1e-3, 1e-5)
        self.telemetry = telemetry
        self.topics = Topics(telemetry)
        self.outbox = Outbox(Encoder(Identity()), Line(), 0)
        self.streams = Streams(telemetry, self.topics, self.outbox, LinkKind.ONBOARD, seed)
        self.parser = dialect.MAVLink(None)
        self.sent_us: dict[int, list[int]] = {}
        self.last: dict[int, object] = {}

    def run(self, seconds: float) -> None:
        """Let time pass; ``sent_us`` then holds what was sent in it."""
        self.sent_us = {}
        for _ in range(round(seconds * 250)):
            self.sample = replace(self.sample, time_boot_us=self.sample.time_boot_us + 4_000)
            self.telemetry.sample = self.sample
            new_position = self.sample.time_boot_us % 8_000 == 0
            if new_position:
                self.telemetry.published = self.sample
            self.topics.count(new_position)
            self.streams.update()
            self.take()

    def take(self) -> None:
        for raw in self.outbox.take():
            message = self.parser.decode(bytearray(raw))
            self.sent_us.setdefault(message.get_msgId(), []).append(self.sample.time_boot_us)
            self.last[message.get_msgId()] = message

    def rate_hz(self, message_id: int, seconds: float = 20.0) -> float:
        self.run(seconds)
        return len(self.sent_us.get(message_id, [])) / seconds

    def gaps_ms(self, message_id: int) -> list[int]:
        return [(b - a) // 1000 for a, b in pairwise(self.sent_us[message_id])]


@pytest.fixture
def on_time(monkeypatch):
    """No loop of the link comes too late."""
    monkeypatch.setattr(module, "MISSED_LOOPS_SHARE", 0.0)


@pytest.mark.parametrize("asked_hz", [250, 500, 1000])
def test_highres_imu_is_at_most_every_sample_but_a_few(asked_hz):
    link = Link()
    assert link.streams.set_interval(HIGHRES_IMU, 1e6 / asked_hz)
    rate_hz = link.rate_hz(HIGHRES_IMU, 60.0)
    assert 245 <= rate_hz <= 249
    gaps = Counter(link.gaps_ms(HIGHRES_IMU))
    assert gaps.keys() == {4, 8}
    assert gaps[8] / len(link.sent_us[HIGHRES_IMU]) == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize(
    ("message_id", "asked_hz", "received_hz", "gaps"),
    [
        (HIGHRES_IMU, 250, 250, {4}),
        (HIGHRES_IMU, 200, 125, {8}),
        (HIGHRES_IMU, 100, 100, {8, 12}),
        (HIGHRES_IMU, 50, 50, {20}),
        (ATTITUDE_QUATERNION, 250, 250, {4}),
        (ODOMETRY, 100, 100, {8, 12}),
        (ODOMETRY, 250, 125, {8}),
        (LOCAL_POSITION_NED, 100, 100, {8, 12}),
        (LOCAL_POSITION_NED, 250, 125, {8}),
        (LOCAL_POSITION_NED, 50, 50, {20}),
    ],
)
def test_asked_and_received(on_time, message_id, asked_hz, received_hz, gaps):
    link = Link()
    link.streams.set_interval(message_id, 1e6 / asked_hz)
    link.run(1.0)
    assert link.rate_hz(message_id) == pytest.approx(received_hz, rel=0.002)
    assert set(link.gaps_ms(message_id)) == gaps


def test_minus_one_stops_and_zero_restores():
    link = Link()
    assert link.streams.set_interval(HIGHRES_IMU, -1)
    assert link.rate_hz(HIGHRES_IMU) == 0
    assert link.streams.set_interval(HIGHRES_IMU, 0)
    assert link.rate_hz(HIGHRES_IMU) == pytest.approx(50, rel=0.02)
    # What is not streamed by default is stopped by 0
    assert link.streams.set_interval(AUTOPILOT_VERSION, 500_000)
    assert link.rate_hz(AUTOPILOT_VERSION) == pytest.approx(2, abs=0.1)
    assert link.streams.set_interval(AUTOPILOT_VERSION, 0)
    assert link.rate_hz(AUTOPILOT_VERSION) == 0


@pytest.mark.parametrize("message_id", [HEARTBEAT, 27, 9999, -1])
def test_what_cannot_be_asked_for(message_id):
    assert not Link().streams.set_interval(message_id, 4_000)


@pytest.mark.parametrize(
    ("asked_us", "announced_us"), [(4_000, 4_000), (5_000, 5_000), (-1, -1), (0, 20_000), (100_000, 100_000)]
)
def test_the_announced_interval_is_the_one_asked_for(asked_us, announced_us):
    link = Link()
    link.streams.set_interval(HIGHRES_IMU, asked_us)
    link.streams.announce_interval(HIGHRES_IMU)
    link.take()
    assert link.last[MESSAGE_INTERVAL].message_id == HIGHRES_IMU
    assert link.last[MESSAGE_INTERVAL].interval_us == announced_us


@pytest.mark.parametrize(("asked_us", "kept_us"), [(4_000.0, 4_000), (33_333.0, 33_333), (0.5, 1), (1e30, -1)])
def test_an_interval_goes_through_a_rate_and_back(asked_us, kept_us):
    assert interval_from_request(asked_us) == pytest.approx(kept_us, abs=1)


def test_a_message_can_be_requested_if_there_is_anything_new_in_it():
    link = Link()
    link.run(1.0)
    assert link.streams.send_now(AUTOPILOT_VERSION)
    assert link.streams.send_now(EXTENDED_SYS_STATE)
    link.streams.set_interval(HIGHRES_IMU, 4_000)
    link.run(0.1)
    while link.sent_us[HIGHRES_IMU][-1] != link.sample.time_boot_us:
        link.run(0.004)
    assert not link.streams.send_now(HIGHRES_IMU)
    assert not link.streams.send_now(9999)
    link.take()
    assert link.last[AUTOPILOT_VERSION].flight_sw_version >> 16 == (1 << 8 | 17)


def test_current_mode_comes_on_a_change_and_twice_a_second_at_most_otherwise():
    # Given CURRENT_MODE asked for at 50 Hz
    link = Link()
    link.streams.set_interval(CURRENT_MODE, 20_000)
    assert link.rate_hz(CURRENT_MODE) == pytest.approx(2.0, abs=0.1)
    # When the mode changes
    changed_us = link.sample.time_boot_us
    assert link.autopilot.request_mode(Mode.OFFBOARD) == 0
    link.run(0.1)
    # Then it says so at once
    assert link.sent_us[CURRENT_MODE][0] - changed_us <= 8_000
    message = link.last[CURRENT_MODE]
    assert message.custom_mode == message.intended_custom_mode == 0x00060000
