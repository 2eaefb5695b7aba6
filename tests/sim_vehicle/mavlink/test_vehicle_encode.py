"""What the messages contain, and the silent rule of STATUSTEXT."""

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import Identity, Severity, StatusText
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.services.texts import TextLink


def read_back(message):
    return dialect.MAVLink(None).decode(bytearray(Encoder(Identity()).packet(message)))


ARMED = StatusText(Severity.INFO, "Armed by external command")


def test_a_long_text_comes_in_pieces():
    link = TextLink()
    link.heard_us = 0
    link.add(ARMED, 0)
    long = StatusText(Severity.CRITICAL, "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported")
    link.add(long, 0)
    assert len(list(link.due(0))) == 1
    # The next text not before 50 ms
    assert list(link.due(48_000)) == []
    pieces = [read_back(message) for message in link.due(52_000)]
    assert [(piece.id, piece.chunk_seq, piece.severity) for piece in pieces] == [(1, 0, 2), (1, 1, 2)]
    assert "".join(piece.text.rstrip("\0") for piece in pieces) == long.text + "\t"
    assert len(pieces[0].text) == 50


LAYOUTS = [value for value in vars(framing).values() if isinstance(value, framing.Layout)]
FLAT = [found[0] for kind in dialect.mavlink_map.values() if (found := framing.flattened(kind)) is not None]


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
@pytest.mark.parametrize("kept", [0, 1, 3, 100], ids=lambda kept: f"{kept} fields, then zeros")
def test_frequent_messages_are_framed_as_pymavlink_frames_them(layout, kept):
    theirs = example(layout, kept)
    for sequence in (0, 255):
        link, encoder = dialect.MAVLink(None, 1, 1), Encoder(Identity())
        link.seq = encoder._link.seq = sequence
        ours = encoder.packet((layout, layout.pack(*in_wire_order(theirs))))
        assert ours == theirs.pack(link)
        assert encoder._link.seq == (sequence + 1) % 256
        assert dialect.MAVLink(None).decode(bytearray(ours)).to_dict() == theirs.to_dict()


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
def test_frequent_messages_are_signed_as_pymavlink_signs_them(layout):
    theirs, link, encoder = example(layout, 4), dialect.MAVLink(None, 1, 1), Encoder(Identity())
    link.signing.secret_key, link.signing.sign_outgoing, link.signing.timestamp = b"k" * 32, True, 77
    encoder.sign(b"k" * 32, 0, 77)
    assert encoder.packet((layout, layout.pack(*in_wire_order(theirs)))) == theirs.pack(link)


@pytest.mark.parametrize("kept", [0, 2, 100])
def test_messages_without_texts_and_arrays_are_packed_as_pymavlink_packs_them(kept):
    link, encoder = dialect.MAVLink(None, 1, 1), Encoder(Identity())
    assert len(FLAT) > 100
    for layout in FLAT:
        message = example(layout, kept)
        assert encoder.packet(message) == message.pack(link), layout.name
        link.seq = (link.seq + 1) % 256


def example(layout, kept):
    """One of pymavlink's messages, whose fields are zero but for the first on the wire. Halves and small whole numbers
    are the same in every type.
    """
    kind = dialect.mavlink_map[layout.number]
    values, number = {}, 1
    for name, length in zip(kind.ordered_fieldnames, kind.lengths, strict=True):
        is_whole = "int" in kind.fieldtypes[kind.fieldnames.index(name)]
        given = [(number + place if is_whole else -0.5 * (number + place)) for place in range(length)]
        given = [value if number <= kept else 0 for value in given]
        values[name] = given[0] if length == 1 else given
        number += length
    return kind(**values)


def in_wire_order(message):
    for name in message.ordered_fieldnames:
        value = getattr(message, name)
        yield from value if isinstance(value, tuple | list) else (value,)
