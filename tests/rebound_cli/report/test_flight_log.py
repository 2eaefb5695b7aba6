"""A log's packets in columns: the samples that the companion hears of the same packets, one by one, and no others."""

import struct
from dataclasses import fields
from random import Random

import numpy as np

from companion.mavlink.decode import WRAP_US, Decoder
from companion.mavlink.packet import HEADER_V2, message_id_of
from companion.messages import MessageId
from companion.shell.tlog import read_tlog
from rebound_cli.flight_log import flight_log_of, flight_log_of_packets

SHOWN = (MessageId.HIGHRES_IMU, MessageId.LOCAL_POSITION_NED, MessageId.ATTITUDE_QUATERNION)


def packets_of(folder):
    return [(at_us, packet) for at_us, packet in read_tlog(folder / "flight.tlog") if message_id_of(packet) in SHOWN]


def one_by_one(packets):
    """Each by the decoder, which takes every packet for whole."""
    decoder = Decoder(is_packet=lambda *_: True)
    decoder.listen_to(1, 1)
    return flight_log_of((at_us, sample) for at_us, packet in packets for _, sample in decoder.feed(packet) if sample)


def assert_the_same(packets):
    together, expected = flight_log_of_packets(packets), one_by_one(packets)
    for field in fields(together):
        assert np.array_equal(getattr(together, field.name), getattr(expected, field.name)), field.name
    return together


def test_what_no_vehicle_can_truly_say_is_left_out(wall_folder):
    # Given a byte of each payload that is another one: NaN, vectors too long, no rotation, no accelerometer
    random, damaged = Random(1), []
    for at_us, packet in packets_of(wall_folder):
        place = HEADER_V2 + random.randrange(packet[1])
        damaged.append((at_us, packet[:place] + bytes([random.choice((0, 0x7F, 0xFF))]) + packet[place + 1 :]))
    log = assert_the_same(damaged)
    # Then some of each stream are left, and some are not
    for rows, sent in ((log.imu_at_us, 6462), (log.position_at_us, 1330), (log.attitude_at_us, 1350)):
        assert 0.2 < len(rows) / sent < 0.95


def test_stamps_of_32_bits_go_on_after_49_days(wall_folder):
    # Given a flight that begins so long after the boot that milliseconds begin again in the middle of it
    since_us = WRAP_US - 10_000_000
    later = []
    for at_us, packet in packets_of(wall_folder):
        is_imu = message_id_of(packet) == MessageId.HIGHRES_IMU
        layout = struct.Struct("<Q" if is_imu else "<I")
        (stamp,) = layout.unpack_from(packet, HEADER_V2)
        moved = stamp + since_us if is_imu else (stamp + since_us // 1000) % 2**32
        later.append((at_us, packet[:HEADER_V2] + layout.pack(moved) + packet[HEADER_V2 + layout.size :]))
    log = assert_the_same(later)
    assert log.position_time_boot_us.max() > WRAP_US and (np.diff(log.position_time_boot_us) > 0).all()
