"""The telemetry log against pymavlink's own reader, and after a kill."""

from pymavlink import mavutil

from bench.fly.packets import GROUND_STATION, made
from companion.mavlink.decode import Decoder
from companion.shell.tlog import FLUSH_INTERVAL_US, TlogWriter, may_be_logged, read_tlog

EPOCH_US = 1_600_000_000_000_000


def heartbeats(count):
    return [
        made("HEARTBEAT", {"custom_mode": number, "mavlink_version": 3}, number=number % 256) for number in range(count)
    ]


def written(path, packets):
    """A log that is still open."""
    writer = TlogWriter(path)
    for number, packet in enumerate(packets):
        writer.write(EPOCH_US + 4000 * number, [packet])
    return writer


def test_pymavlinks_reader_finds_every_packet_and_its_time(tmp_path):
    # Given a log written by us
    written(tmp_path / "flight.tlog", heartbeats(5)).close()
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


def test_a_killed_writer_leaves_all_but_the_last_moment(tmp_path):
    # Given a writer that is never closed
    path = tmp_path / "flight.tlog"
    writer = written(path, heartbeats(1000))
    # When the file is read as a kill would leave it
    last_us = list(read_tlog(path))[-1][0]
    # Then at most the flush interval is missing
    assert EPOCH_US + 4000 * 999 - last_us <= FLUSH_INTERVAL_US
    writer.close()


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
