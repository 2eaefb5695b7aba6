"""Telemetry logs of any program: several systems on one link, one PX4 vehicle chosen, its samples in order."""

import struct

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.messages import ExtendedState, Heartbeat, ImuSample, LandedState, PositionTarget
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log

EPOCH_US = 1_600_000_000_000_000
PX4, GENERIC, GROUND_STATION, NO_AUTOPILOT = 12, 0, 6, 8


class Writer:
    """Packets of several systems on one log, one every 4 ms."""

    def __init__(self):
        self.content = b""
        self.count = 0
        self._senders = {}

    def send(self, message, system=1, component=1, at_us=None):
        mavlink = self._senders.setdefault((system, component), dialect.MAVLink(None, system, component))
        packet = message.pack(mavlink)
        mavlink.seq = (mavlink.seq + 1) % 256
        self.content += struct.pack(">Q", EPOCH_US + 4000 * self.count if at_us is None else at_us) + packet
        self.count += 1

    def heartbeat(self, system=1, component=1, kind=2, autopilot=PX4):
        self.send(dialect.MAVLink_heartbeat_message(kind, autopilot, 0x81, 6 << 16, 4, 3), system, component)

    def imu(self, system=1, x=0.0, at_us=None):
        message = dialect.MAVLink_highres_imu_message(
            5000 * self.count, x, 0.0, -9.8, 0.1, 0.2, 0.3, 0, 0, 0, 0, 0, 0, 0, 0x3F
        )
        self.send(message, system, at_us=at_us)

    def read(self, folder):
        path = folder / "flight.tlog"
        path.write_bytes(self.content)
        return read_log(path)


@pytest.fixture
def log():
    return Writer()


def test_the_vehicles_samples_come_with_the_time_they_were_heard(log, tmp_path):
    log.heartbeat()
    for x in (1.0, 2.0, 3.0):
        log.imu(x=x)
    log.send(dialect.MAVLink_extended_sys_state_message(0, 2))
    read = log.read(tmp_path)
    assert [type(heard.sample) for heard in read.heard] == [Heartbeat, ImuSample, ImuSample, ImuSample, ExtendedState]
    assert [heard.at_us - EPOCH_US for heard in read.heard] == [0, 4000, 8000, 12_000, 16_000]
    assert [sample.specific_force_frd_m_s2[0] for _, sample in read.imu()] == [1.0, 2.0, 3.0]
    assert read.heard[-1].sample.landed_state is LandedState.IN_AIR
    assert "ATTITUDE_TARGET is not in it" in read.losses
    assert "EXTENDED_SYS_STATE is not in it" not in read.losses


def test_of_several_systems_the_known_vehicle_with_imu_samples_is_taken(log, tmp_path):
    # Given a ground station, a gimbal, a vehicle of an unknown autopilot and two PX4 vehicles on one link
    log.heartbeat(system=255, component=190, kind=GROUND_STATION, autopilot=NO_AUTOPILOT)
    log.heartbeat(system=1, component=154, kind=26, autopilot=NO_AUTOPILOT)
    log.heartbeat(system=3, autopilot=GENERIC)
    log.heartbeat(system=4)
    log.heartbeat(system=5)
    for _ in range(3):
        log.imu(system=3, x=3.0)
        log.imu(system=5, x=5.0)
    # Then the one that can be looked at is, and the other is named
    read = log.read(tmp_path)
    assert [sample.specific_force_frd_m_s2[0] for _, sample in read.imu()] == [5.0] * 3
    assert any("system 5 was taken, not 4" in loss for loss in read.losses)


@pytest.mark.parametrize(
    ("fill", "words"),
    [
        (lambda log: log.heartbeat(autopilot=GENERIC), "autopilot is not PX4 or ArduPilot but generic autopilot"),
        (lambda log: log.imu(), "no autopilot's heartbeat"),
        (lambda log: log.heartbeat(), "no HIGHRES_IMU from system 1"),
    ],
)
def test_a_log_without_a_vehicle_to_look_at_is_one_sentence(log, tmp_path, fill, words):
    fill(log)
    fill(log)
    with pytest.raises(LogError, match=words):
        log.read(tmp_path)


def test_bytes_that_are_no_log_are_one_sentence(log, tmp_path):
    for log.content, words in ((bytes(range(256)) * 20, "not a telemetry log"), (b"", "empty")):
        with pytest.raises(LogError, match=words):
            log.read(tmp_path)


def test_a_clock_that_is_set_back_loses_nothing(log, tmp_path):
    log.heartbeat()
    log.imu()
    for _ in range(5):
        log.imu(at_us=EPOCH_US - 3_600_000_000)
    assert len(log.read(tmp_path).imu()) == 6


@pytest.mark.parametrize(
    ("mask", "expected"),
    [
        (0x000, PositionTarget((1.0, 2.0, -3.0), 0.25)),
        (0x038, PositionTarget((1.0, 2.0, -3.0), None)),
        (0x007, PositionTarget(None, 0.25)),
    ],
)
def test_what_the_position_control_was_asked_for(log, tmp_path, mask, expected):
    log.heartbeat()
    log.imu()
    log.imu()
    place, velocity, others = (1.0, 2.0, -3.0), (0.5, 0.0, 0.25), [0.0] * 5
    log.send(dialect.MAVLink_position_target_local_ned_message(7, 1, mask, *place, *velocity, *others))
    samples = [heard.sample for heard in log.read(tmp_path).heard]
    assert [sample for sample in samples if isinstance(sample, PositionTarget)] == [expected]
