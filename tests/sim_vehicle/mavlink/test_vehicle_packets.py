"""Bytes in and out: whole, split, damaged or of any content; what messages contain; and the vehicle flies on."""

import math
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import Command, Identity, Severity, StatusText
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.services.command_service import command_from_int, command_from_long
from sim_vehicle.mavlink.services.setpoint_service import position_target
from sim_vehicle.mavlink.services.texts import TextLink
from tests.filled import example
from tests.sim_vehicle.autopilot.kinematic_plant import target
from tests.sim_vehicle.vehicle_client import Client

KINDS = tuple(dialect.mavlink_map.values())
# What changes the vehicle when it is addressed to it. Everything else must leave it as it is.
OBEYED = frozenset({11, 20, 21, 23, 43, 44, 45, 47, 51, 69, 73, 75, 76, 82, 84, 144, 256})


def packet(kind: Any, payload: bytes, link: dialect.MAVLink, v1: bool = False) -> bytes:
    """A packet of ``kind`` whose checksum is right, whatever its payload."""
    message = kind.__new__(kind)
    dialect.MAVLink_message.__init__(message, kind.id, kind.msgname)
    raw: bytes = message._pack(link, kind.crc_extra, payload, force_mavlink1=v1 and kind.id < 256)
    link.seq = (link.seq + 1) % 256
    return raw


def random_payload(kind: type, chance: random.Random) -> bytes:
    """Noise, now and then with the special numbers of floats in it."""
    payload = bytearray(chance.randbytes(kind.unpacker.size))
    for _ in range(chance.randrange(3)):
        if len(payload) >= 4:
            at = 4 * chance.randrange(len(payload) // 4)
            payload[at : at + 4] = chance.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\0\0\0\0"))
    return bytes(payload)


def addressed_to(kind: type, payload: bytes, system: int, component: int) -> bytes:
    """The payload with these targets, where the message has any."""
    values = list(kind.unpacker.unpack(payload))
    for name, value in (("target_system", system), ("target_component", component), ("target", system)):
        if name in kind.fieldnames:
            # Fields before the targets may be arrays of several numbers each
            before = kind.ordered_fieldnames[: kind.ordered_fieldnames.index(name)]
            types = [kind.fieldtypes[kind.fieldnames.index(field)] for field in before]
            counts = (1 if of == "char" else count or 1 for of, count in zip(types, kind.array_lengths, strict=False))
            values[sum(counts)] = value
    packed: bytes = kind.unpacker.pack(*values)
    return packed


def packed(message, v1=False) -> bytes:
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    return message.pack(link, force_mavlink1=v1)


def target_message(frame, mask, *values):
    return dialect.MAVLink_set_position_target_local_ned_message(7, 1, 1, frame, mask, *values)


NUMBERS = (1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.5, 0.25)


TARGETS = [
    (target_message(1, 0xDF8, *NUMBERS), target(position=(1.0, 2.0, -3.0))),
    (target_message(1, 0xDC7, *NUMBERS), target(velocity=(4.0, 5.0, 6.0))),
    (target_message(1, 0x9C0, *NUMBERS), target(position=(1.0, 2.0, -3.0), velocity=(4.0, 5.0, 6.0), yaw_rad=0.5)),
    (target_message(8, 0x5C7, *NUMBERS), target(frame=8, velocity=(4.0, 5.0, 6.0), yaw_rate_rad_s=0.25)),
    (target_message(1, 0xE3F, *NUMBERS), target(acceleration_m_s2=(7.0, 8.0, 9.0), is_force=True)),
    (target_message(1, 0xFFF, *NUMBERS), target(is_force=True)),
    (target_message(1, 0xDFB, *NUMBERS), target(position=(None, None, -3.0))),
    (target_message(1, 0xDF8, math.nan, math.inf, -3.0, *NUMBERS[3:]), target(position=(None, None, -3.0))),
]


@pytest.mark.parametrize(("message", "expected"), TARGETS)
def test_what_a_setpoint_leaves_out_or_cannot_say_is_none(message, expected):
    assert position_target(framing.read(packed(message))) == expected


def test_commands_of_both_kinds_are_one_value():
    long = dialect.MAVLink_command_long_message(1, 1, 511, 0, 105.0, 4000.0, 0.5, 0.25, 5.0, 6.0, 7.0)
    assert command_from_long(framing.read(packed(long))) == Command(
        1, 191, 1, 1, 511, 105.0, 4000.0, 0.5, 0.25, 5.0, 6.0, 7.0
    )
    whole = dialect.MAVLink_command_int_message(1, 1, 6, 22, 0, 0, 1.0, 2.0, 3.0, 4.0, 473977418, 85455939, 12.5)
    assert command_from_int(framing.read(packed(whole))) == Command(
        1, 191, 1, 1, 22, 1.0, 2.0, 3.0, 4.0, 47.3977418, 8.5455939, 12.5
    )


READ = (*OBEYED, 0, 4, 110, 111)


@pytest.mark.parametrize("size", [1, 1000], ids=["byte by byte", "at once"])
@pytest.mark.parametrize("v1", [False, True], ids=["mavlink2", "mavlink1"])
def test_packets_are_found_in_whatever_pieces_they_come(size, v1):
    # Given one between two that is not read, whose fields include one called id
    text = dialect.MAVLink_statustext_message(6, b"said by a companion", 0, 0)
    messages = (dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), text, TARGETS[0][0])
    stream, decoder = b"".join(packed(message, v1) for message in messages), Decoder(Identity(), READ)
    found = [got for at in range(0, len(stream), size) for got in decoder.push(stream[at : at + size])]
    assert [message.get_msgId() for message in found] == [0, 84]


@pytest.mark.parametrize("number", sorted(READ), ids=lambda number: dialect.mavlink_map[number].msgname)
def test_a_packet_is_read_field_by_field_as_pymavlink_reads_it(number):
    """Of any content, whole, with zeros at its end that are left out, with more than the dialect knows, signed."""
    kind, chance, link = dialect.mavlink_map[number], random.Random(number), dialect.MAVLink(None, 7, 191)
    for signs in (False, True):
        link.signing.secret_key, link.signing.sign_outgoing = b"k" * 32, signs
        for payload in [random_payload(kind, chance) for _ in range(20)] + [bytes(kind.unpacker.size)]:
            for content in (payload, payload[:2] + bytes(len(payload) - 2), (payload + b"\x01\x02")[:255]):
                raw = packet(kind, content, link, v1=number < 256 and chance.random() < 0.3)
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


def test_a_long_text_comes_in_pieces():
    link, heard_us = TextLink(), 60_000_000
    link.heard_us = heard_us
    link.add(StatusText(Severity.INFO, "Armed by external command"), heard_us)
    long = StatusText(Severity.CRITICAL, "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported")
    link.add(long, heard_us)
    assert len(list(link.due(heard_us))) == 1
    # The next text not before 50 ms
    assert list(link.due(heard_us + 48_000)) == []
    packets = [Encoder(Identity()).packet(message) for message in link.due(heard_us + 52_000)]
    pieces = [dialect.MAVLink(None).decode(bytearray(packet)) for packet in packets]
    assert [(piece.id, piece.chunk_seq, piece.severity) for piece in pieces] == [(1, 0, 2), (1, 1, 2)]
    assert "".join(piece.text.rstrip("\0") for piece in pieces) == long.text + "\t"
    assert len(pieces[0].text) == 50


LAYOUTS = [value for value in vars(framing).values() if isinstance(value, framing.Layout)]
FLAT = [found[0] for kind in dialect.mavlink_map.values() if (found := framing.flattened(kind)) is not None]


@pytest.mark.parametrize("kept", [0, 1, 2, 3, 100], ids=lambda kept: f"{kept} fields, then zeros")
def test_messages_are_packed_by_their_layout_as_pymavlink_packs_them(kept):
    link, encoder = dialect.MAVLink(None, 1, 1), Encoder(Identity())
    assert len(FLAT) > 100
    flat = [example(layout.number, kept) for layout in FLAT]
    frequent = [(layout, example(layout.number, kept)) for layout in LAYOUTS]
    pairs = [(message, message) for message in flat]
    pairs += [((layout, layout.pack(*in_wire_order(theirs))), theirs) for layout, theirs in frequent]
    # Three times: the sequence has 256 numbers
    for ours, theirs in 3 * pairs:
        assert encoder.packet(ours) == theirs.pack(link), theirs.get_type()
        link.seq = (link.seq + 1) % 256


def in_wire_order(message):
    for name in message.ordered_fieldnames:
        value = getattr(message, name)
        yield from value if isinstance(value, tuple | list) else (value,)


def state(client: Client) -> tuple:
    """What a packet that means nothing to this vehicle must not change."""
    autopilot = client.vehicle._board.autopilot
    parameters = client.vehicle.parameters
    return (
        autopilot.modes.flown,
        autopilot.modes.intended,
        autopilot.arming.armed,
        parameters.sets,
        autopilot.navigator.view.home_ned_m,
    )


def flying() -> Client:
    client = Client(system=255, component=190)
    client.take_off(9.0)
    assert client.armed()
    return client


def test_every_kind_of_message_with_senseless_content_is_survived_in_flight():
    chance, client = random.Random(21), flying()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    for number in range(6_000):
        kind = KINDS[number % len(KINDS)]
        payload = addressed_to(kind, random_payload(kind, chance), chance.choice((0, 1)), chance.choice((0, 1)))
        client.push(packet(kind, payload, link, v1=chance.random() < 0.1))
        if number % 4 == 0:
            client.step()
    client.run(2.5)
    assert client.last("HEARTBEAT").autopilot == 12


def test_what_is_not_for_this_vehicle_changes_nothing():
    chance, client = random.Random(22), flying()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    before = state(client)
    client.forget()
    for number in range(4_000):
        kind = KINDS[number % len(KINDS)]
        payload = random_payload(kind, chance)
        if kind.id in OBEYED:
            payload = addressed_to(kind, payload, chance.randrange(2, 256), chance.randrange(256))
        # The setpoints of a follow-me target and clocks of peers are for everybody
        if kind.id in (111, 144):
            continue
        client.push(packet(kind, payload, link))
        if number % 8 == 0:
            client.step()
    client.run(0.1)
    assert state(client) == before
    assert client.all("COMMAND_ACK") == []


@settings(max_examples=150, deadline=None)
@given(st.lists(st.binary(max_size=400), max_size=8))
def test_any_bytes_are_read_without_an_error_and_hold_nothing_up(pieces):
    decoder = Decoder(Identity(), range(1000))
    for piece in pieces:
        decoder.push(piece)
    # What is left of noise cannot hide more than one longest packet
    heartbeat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(dialect.MAVLink(None, 255, 190))
    assert any(decoder.push(heartbeat))


COMMANDS = st.one_of(st.integers(0, 700), st.sampled_from([2000, 2001, 2500, 3000, 30001, 43003]))
ANY_NUMBER = st.one_of(st.floats(width=32), st.integers(-3, 300).map(float), st.sampled_from([360.0, 397.0, 435.0]))


@pytest.fixture(scope="module")
def airborne() -> Client:
    return flying()


@settings(max_examples=200, deadline=None)
@given(command=COMMANDS, params=st.lists(ANY_NUMBER, min_size=7, max_size=7), is_int=st.booleans())
def test_every_command_with_any_parameter_is_answered_at_most_twice(airborne, command, params, is_int):
    client = airborne
    client.forget()
    if is_int:
        x, y = (int(max(min(value, 2e9), -2e9)) if value == value else 0 for value in params[4:6])
        client.send(dialect.MAVLink_command_int_message(1, 1, 6, command, 0, 0, *params[:4], x, y, params[6]))
    else:
        client.command(command, *params)
    client.run(0.02)
    assert len(client.results(command)) <= 2
