"""Telemetry logs of any program, one PX4 vehicle of several; and any log, damaged: read, or refused in one sentence."""

import struct

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as dialect

from companion.messages import ExtendedState, Heartbeat, ImuSample, LandedState, PositionTarget
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.watching import watch_log
from tests.rebound_cli.logs.test_dataflash import dataflash, imu
from tests.rebound_cli.logs.test_ulog import every, sensor_combined, ulog

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
        (lambda log: log.heartbeat(autopilot=GENERIC), "autopilot is not PX4 or ArduPilot \\(MAV_AUTOPILOT"),
        (lambda log: log.imu(), "no autopilot's heartbeat"),
        (lambda log: log.heartbeat(), "no HIGHRES_IMU from system 1"),
        (lambda log: setattr(log, "content", bytes(range(256)) * 20), "not a telemetry log"),
        (lambda log: None, "empty"),
    ],
)
def test_a_log_without_a_vehicle_to_look_at_is_one_sentence(log, tmp_path, fill, words):
    fill(log)
    fill(log)
    with pytest.raises(LogError, match=words):
        log.read(tmp_path)


def test_a_clock_that_is_set_back_and_a_damaged_stamp_lose_nothing_and_no_time_goes_back(log, tmp_path):
    log.heartbeat()
    log.imu()
    for number in range(5):
        log.imu(at_us=EPOCH_US - 3_600_000_000 + 4000 * number)
    log.imu(at_us=EPOCH_US + 2 * 24 * 3_600_000_000)
    read = log.read(tmp_path)
    assert [(at_us - EPOCH_US) // 4000 for at_us, _ in read.imu()] == [1, 1, 2, 3, 4, 5, 5]
    assert read.duration_s == pytest.approx(0.02)


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


ULOG = ulog(
    {
        "sensor_combined": sensor_combined(every(5000, 0, 200_000)),
        "vehicle_attitude": ("q", [(1000, (1.0, 0.0, 0.0, 0.0))]),
        "vehicle_status": ("nav_state arming_state", [(0, 14, 2)]),
        "vehicle_land_detected": ("landed", [(0, True), (50_000, False)]),
    },
    parameters=[("MPC_THR_HOVER", 0.5)],
)


TELEMETRY = Writer()
TELEMETRY.heartbeat()
for _ in range(40):
    TELEMETRY.imu()
EVENTS = [("EV", 1_010_000, 10), ("MODE", 1_010_000, 2, 2, 1), ("EV", 1_020_000, 28)]
PILOTED = [("CTUN", 1_010_000, 0.4, 1.0, 0, 0), ("ATT", 1_011_000, *[0.0] * 6)]
ESTIMATED = [("XKF1", 1_010_000, 0, *[0.0] * 9), ("XKF4", 1_010_000, 0, 7, 0)]
DATAFLASH = dataflash(
    [
        ("MSG", 0, "ArduCopter V4.5.7"),
        ("PARM", 0, "INS_ACCEL_FILTER", 20.0, 20.0),
        *EVENTS,
        *PILOTED,
        *ESTIMATED,
        *imu(every(5000, 1_000_000, 1_200_000)),
    ]
)

changes = st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.binary(min_size=1, max_size=8)), max_size=8)
cuts = st.floats(0.0, 1.0)


def damaged(content, spots, kept):
    damaged = bytearray(content)
    for place, patch in spots:
        start = int(place * len(damaged))
        damaged[start : start + len(patch)] = patch
    return bytes(damaged[: round(kept * len(damaged))])


def read_or_refused(path, content):
    path.write_bytes(content)
    try:
        log = read_log(path)
    except LogError as error:
        assert str(path) in str(error) and "\n" not in str(error) and str(error).endswith(".")
    else:
        watch_log(log, CompanionConfig())


LOGS = {"log.ulg": ULOG, "log.tlog": TELEMETRY.content, "log.bin": DATAFLASH}


@pytest.mark.parametrize("name", LOGS)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes, cuts)
@example([], 1.0)
@example([(0.4302391427239161, b"\x00"), (0.4439984279533176, b"\x01")], 1.0)  # no attitude is left
def test_a_damaged_log_of_each_kind(tmp_path, name, spots, kept):
    read_or_refused(tmp_path / name, damaged(LOGS[name], spots, kept))


def test_a_head_that_ends_in_a_damaged_message(tmp_path):
    # Given a message of no type that is said to be longer than what is left of the file, by just so much that its
    # reader, going back over it, meets the beginning of an earlier message, and so for ever
    note = struct.pack("<HB", 915, ord("I")) + bytes([14]) + b"char[900] text" + bytes(900)
    head = ULOG[:59] + 13 * note
    size = len(head) + 1 - 59 - len(note)
    assert size > 10_000
    read_or_refused(tmp_path / "log.ulg", head + struct.pack("<HB", size, 0))


@pytest.mark.parametrize("length", [0, 1, 2])
def test_a_message_of_no_length_is_no_endless_loop(tmp_path, length):
    # Given a format that says that its messages are shorter than their own head
    spoilt = LOGS["log.bin"].replace(b"\xa3\x95\x80\x83", b"\xa3\x95\x80\x83" + bytes([length]))
    (tmp_path / "log.bin").write_bytes(spoilt)
    with pytest.raises(LogError, match="has no length"):
        read_log(tmp_path / "log.bin")


def test_a_hole_in_a_log_prints_nothing(tmp_path, capfd):
    # Given a log that lacks some bytes in the middle of its messages
    content = LOGS["log.bin"]
    middle = len(content) // 2
    (tmp_path / "log.bin").write_bytes(content[:middle] + content[middle + 33 :])
    # When it is read, then nothing comes out on the way, not even from compiled code
    read_log(tmp_path / "log.bin")
    assert capfd.readouterr() == ("", "")
