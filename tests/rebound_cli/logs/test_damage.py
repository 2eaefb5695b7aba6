"""Whatever bytes a log holds, it is read, or refused in one sentence."""

import struct

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.watching import watch_log
from tests.rebound_cli.logs import dataflash_file
from tests.rebound_cli.logs.test_telemetry import Writer
from tests.rebound_cli.logs.ulog_file import every, sensor_combined, ulog

ULOG = ulog(
    {
        "sensor_combined": sensor_combined(every(5000, 0, 200_000)),
        "vehicle_attitude": ("q", [(1000, (1.0, 0.0, 0.0, 0.0))]),
        "vehicle_status": ("nav_state arming_state", [(0, 14, 2)]),
        "vehicle_land_detected": ("landed", [(0, True), (50_000, False)]),
    },
    parameters=[("MPC_THR_HOVER", 0.5)],
)


def telemetry():
    log = Writer()
    log.heartbeat()
    for _ in range(40):
        log.imu()
    return log.content


TELEMETRY = telemetry()
EVENTS = [("EV", 1_010_000, 10), ("MODE", 1_010_000, 2, 2, 1), ("EV", 1_020_000, 28)]
PILOTED = [("CTUN", 1_010_000, 0.4, 1.0, 0, 0), ("ATT", 1_011_000, *[0.0] * 6)]
ESTIMATED = [("XKF1", 1_010_000, 0, *[0.0] * 9), ("XKF4", 1_010_000, 0, 7, 0)]
DATAFLASH = dataflash_file.dataflash(
    [
        ("MSG", 0, "ArduCopter V4.5.7"),
        ("PARM", 0, "INS_ACCEL_FILTER", 20.0, 20.0),
        *EVENTS,
        *PILOTED,
        *ESTIMATED,
        *dataflash_file.imu(every(5000, 1_000_000, 1_200_000)),
    ],
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


LOGS = {
    "log.ulg": ULOG,
    "log.tlog": TELEMETRY,
    "log.bin": DATAFLASH,
}


@pytest.mark.parametrize("name", LOGS)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes, cuts)
@example([], 1.0)
def test_a_damaged_log_of_each_kind(tmp_path, name, spots, kept):
    read_or_refused(tmp_path / name, damaged(LOGS[name], spots, kept))


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.sampled_from(list(LOGS)))
def test_bytes_from_anywhere(tmp_path, content, name):
    read_or_refused(tmp_path / name, content)


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
