"""Bytes in: whole, split and damaged; and the values of commands and setpoints."""

import math
import random

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import Command, Identity
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.services.command_service import command_from_int, command_from_long
from sim_vehicle.mavlink.services.setpoint_service import position_target
from tests.sim_vehicle import packets
from tests.sim_vehicle.autopilot.kinematic_plant import target

NAN = math.nan


def packet(message, v1=False) -> bytes:
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    return message.pack(link, force_mavlink1=v1)


def target_message(frame, mask, *values):
    return dialect.MAVLink_set_position_target_local_ned_message(7, 1, 1, frame, mask, *values)


NUMBERS = (1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.5, 0.25)


TARGETS = [
    (target_message(1, 0xDF8, *NUMBERS), target(position=(1.0, 2.0, -3.0))),
    (target_message(1, 0xDC7, *NUMBERS), target(velocity=(4.0, 5.0, 6.0))),
    (
        target_message(1, 0x9C0, *NUMBERS),
        target(position=(1.0, 2.0, -3.0), velocity=(4.0, 5.0, 6.0), yaw_rad=0.5),
    ),
    (target_message(8, 0x5C7, *NUMBERS), target(frame=8, velocity=(4.0, 5.0, 6.0), yaw_rate_rad_s=0.25)),
    (target_message(1, 0xE3F, *NUMBERS), target(acceleration_m_s2=(7.0, 8.0, 9.0), is_force=True)),
    (target_message(1, 0xFFF, *NUMBERS), target(is_force=True)),
    (target_message(1, 0xDFB, *NUMBERS), target(position=(None, None, -3.0))),
    (target_message(1, 0xDF8, NAN, math.inf, -3.0, *NUMBERS[3:]), target(position=(None, None, -3.0))),
]


@pytest.mark.parametrize(("message", "expected"), TARGETS)
def test_what_a_setpoint_leaves_out_or_cannot_say_is_none(message, expected):
    assert position_target(framing.read(packet(message))) == expected


def test_commands_of_both_kinds_are_one_value():
    long = dialect.MAVLink_command_long_message(1, 1, 511, 0, 105.0, 4000.0, 0.5, 0.25, 5.0, 6.0, 7.0)
    assert command_from_long(framing.read(packet(long))) == Command(
        1, 191, 1, 1, 511, 105.0, 4000.0, 0.5, 0.25, 5.0, 6.0, 7.0
    )
    whole = dialect.MAVLink_command_int_message(1, 1, 6, 22, 0, 0, 1.0, 2.0, 3.0, 4.0, 473977418, 85455939, 12.5)
    assert command_from_int(framing.read(packet(whole))) == Command(
        1, 191, 1, 1, 22, 1.0, 2.0, 3.0, 4.0, 47.3977418, 8.5455939, 12.5
    )


READ = (*packets.OBEYED, 0, 4, 110, 111)
MESSAGES = [
    dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3),
    dialect.MAVLink_timesync_message(0, 123_456_789_012),
    dialect.MAVLink_command_long_message(1, 1, 511, 0, 105.0, 4000.0, 0.5, 0.25, 5.0, 6.0, 7.0),
    # not read; its fields include one called id
    dialect.MAVLink_statustext_message(6, b"said by a companion", 0, 0),
    TARGETS[0][0],
]


def decoder() -> Decoder:
    return Decoder(Identity(), READ)


def ids(messages) -> list[int]:
    return [message.get_msgId() for message in messages]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.get_type())
@pytest.mark.parametrize("v1", [False, True], ids=["mavlink2", "mavlink1"])
def test_each_message_whole_and_byte_by_byte(message, v1):
    raw = packet(message, v1)
    wanted = [number for number in ids([message]) if number in READ]
    assert ids(decoder().push(raw)) == wanted
    parts = decoder()
    assert ids(got for byte in raw for got in parts.push(bytes([byte]))) == wanted


@pytest.mark.parametrize("number", sorted(READ), ids=lambda number: dialect.mavlink_map[number].msgname)
def test_a_packet_is_read_field_by_field_as_pymavlink_reads_it(number):
    """Of any content, whole, with zeros at its end that are left out, with more than the dialect knows, signed."""
    kind, chance, link = dialect.mavlink_map[number], random.Random(number), dialect.MAVLink(None, 7, 191)
    for signs in (False, True):
        link.signing.secret_key, link.signing.sign_outgoing = b"k" * 32, signs
        for payload in [packets.random_payload(kind, chance) for _ in range(20)] + [bytes(kind.unpacker.size)]:
            for content in (payload, payload[:2] + bytes(len(payload) - 2), (payload + b"\x01\x02")[:255]):
                raw = packets.packet(kind, content, link, v1=number < 256 and chance.random() < 0.3)
                ours, theirs = framing.read(raw), dialect.MAVLink(None).decode(bytearray(raw))
                assert repr([plain(ours, name) for name in kind.fieldnames]) == repr(
                    [plain(theirs, name) for name in kind.fieldnames]
                )
                sender = (theirs.get_srcSystem(), theirs.get_srcComponent(), theirs.get_msgId())
                assert (ours.get_srcSystem(), ours.get_srcComponent(), ours.get_msgId()) == sender
                assert bytes(ours.get_msgbuf()) == bytes(theirs.get_msgbuf())


def plain(message, name):
    value = getattr(message, name)
    return tuple(value) if isinstance(value, list) else value
