"""Files of a flight: the key and the time stamp beside it, and the telemetry log against pymavlink's own reader."""

import os

import pytest
from pymavlink import mavutil

from bench.fly.packets import GROUND_STATION, made
from companion.errors import ConfigurationError
from companion.mavlink.decode import Decoder
from companion.mavlink.signing import MINUTE, UNIX_AT_2015_US, stamp_at
from companion.shell.signing_files import StampFile, read_key, write_new
from companion.shell.tlog import TlogWriter, may_be_logged, read_tlog

KEY = bytes(range(32))
NOW_US = UNIX_AT_2015_US + 10**14
NOW = stamp_at(NOW_US)


@pytest.fixture
def file(tmp_path):
    write_new(tmp_path / "key", KEY.hex().encode() + b"\n")
    return tmp_path / "key"


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o610, 0o644])
def test_a_key_that_others_may_use_is_refused_with_the_remedy(file, mode):
    file.chmod(mode)
    with pytest.raises(ConfigurationError, match=f"mode {mode:o}.*chmod 600 {file}"):
        read_key(file)


@pytest.mark.parametrize("content", ["", "secret\n", KEY.hex()[:-1], KEY.hex() + "0", "0" * 64, KEY.hex() + " # mine"])
def test_what_is_no_key_is_refused_without_showing_it(file, content):
    file.write_text(content)
    with pytest.raises(ConfigurationError) as refusal:
        read_key(file)
    assert "not a key" in str(refusal.value) and KEY.hex()[:-1] not in str(refusal.value)
    assert "secret" not in str(refusal.value) and refusal.value.__context__ is None


def test_a_missing_key_is_one_sentence(tmp_path):
    with pytest.raises(ConfigurationError, match=r"No such file.*rebound key new"):
        read_key(tmp_path / "none")


@pytest.mark.parametrize(("now_us", "stamp"), [(NOW_US, NOW), (0, 0)], ids=["now", "before 2015"])
def test_the_first_stamp_is_the_clocks_where_there_is_none_yet(file, now_us, stamp):
    assert StampFile(file).first(now_us) == stamp


@pytest.mark.parametrize("passed_us", [-86_400_000_000, -NOW_US, 0, 10_000_000])
def test_after_a_restart_stamps_go_on_two_minutes_later_whatever_the_clock_says(file, passed_us):
    # Given a companion that kept a stamp, and a clock that was set back, or that a short time has passed on
    StampFile(file).keep(NOW)
    assert StampFile(file).first(NOW_US + passed_us) == NOW + 2 * MINUTE


def test_a_power_cut_leaves_the_old_stamp(file, monkeypatch):
    # Given a stamp that was kept, and a power cut before the next has reached the disk
    StampFile(file).keep(NOW)
    monkeypatch.setattr(os, "fsync", lambda file: (_ for _ in ()).throw(OSError("power cut")))
    with pytest.raises(OSError, match="power cut"):
        StampFile(file).keep(NOW + 10 * MINUTE)
    # Nor does a disk that takes no more leave half a file, which would be in the way of the next try
    with pytest.raises(ConfigurationError, match="cannot be written"):
        write_new(file.with_name("new"), b"0")
    assert sorted(each.name for each in file.parent.iterdir()) == ["key", "key.stamp"]
    monkeypatch.undo()
    # Then the companion begins after the old one, and is not refused
    assert StampFile(file).first(0) == NOW + 2 * MINUTE


@pytest.mark.parametrize("content", ["", "yesterday", "-5", str(2**48)])
def test_a_damaged_stamp_is_one_sentence_with_the_remedy(file, content):
    file.with_name("key.stamp").write_text(content)
    with pytest.raises(ConfigurationError, match="delete it"):
        StampFile(file).first(NOW_US)


def test_a_stamp_that_cannot_be_kept_is_told_before_the_flight(file):
    file.with_name("key.stamp.part").mkdir()
    with pytest.raises(ConfigurationError, match="a folder that you may write to"):
        StampFile(file).first(NOW_US)


EPOCH_US = 1_600_000_000_000_000


def heartbeats(count):
    return [
        made("HEARTBEAT", {"custom_mode": number, "mavlink_version": 3}, number=number % 256) for number in range(count)
    ]


def test_pymavlinks_reader_finds_every_packet_and_its_time(tmp_path):
    # Given a log written by us
    writer = TlogWriter(tmp_path / "flight.tlog")
    for number, packet in enumerate(heartbeats(5)):
        writer.write(EPOCH_US + 4000 * number, [packet])
    writer.close()
    # When the usual tools' reader opens it
    log = mavutil.mavlink_connection(str(tmp_path / "flight.tlog"))
    messages = [log.recv_match(blocking=False) for _ in range(5)]
    # Then it finds all of them, on link 0, at their times
    assert [message.custom_mode for message in messages] == list(range(5))
    times_us = [round(1e6 * (message._timestamp - EPOCH_US / 1e6)) for message in messages]
    assert times_us == list(range(0, 20_000, 4000))
    assert log.recv_match(blocking=False) is None


def test_foreign_bytes_and_a_cut_end_lose_no_whole_packet(tmp_path):
    # Given a log with line noise recorded as it came and a last packet cut short
    first, second, third = heartbeats(3)
    path = tmp_path / "flight.tlog"
    writer = TlogWriter(path)
    writer.write(EPOCH_US, [first, b"\xfd\x03noise\x00\xfe", second])
    writer.write(EPOCH_US + 4000, [third])
    writer.close()
    path.write_bytes(path.read_bytes()[:-4])
    # When it is read, then the whole packets are there
    assert [packet for _, packet in read_tlog(path)] == [first, second]


def test_a_packet_is_what_its_header_and_its_checksum_say():
    (packet,) = heartbeats(1)
    broken = packet[:12] + bytes([packet[12] ^ 1]) + packet[13:]
    for bad in (broken, packet[:-1], b"\0", b"\xfd"):
        frames = [frame for frame, _ in Decoder().feed(packet + bad + packet * 20)]
        assert frames.count(packet) >= 20
        assert [frame for frame in frames if may_be_logged(frame)] == [packet] * frames.count(packet)
        assert b"".join(frame for frame in frames if not may_be_logged(frame)).startswith(bad)


def test_a_packet_with_a_key_is_in_no_log():
    assert not may_be_logged(made("SETUP_SIGNING", {"secret_key": list(range(32))}, GROUND_STATION))
    assert may_be_logged(made("SYSTEM_TIME", {}, GROUND_STATION))
