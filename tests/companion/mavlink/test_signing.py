"""Message signing against pymavlink's as the other end, with the rules of MAVLink's specification; virtual time."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as mav

from companion.link.refusals import LASTING_US
from companion.mavlink.decode import Decoder
from companion.mavlink.signing import FORGED, MINUTE, OLD, REPLAYED, UNIX_AT_2015_US, UNSIGNED, Signing, stamp_at

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
# The stamp of this moment is 10^13.
NOW_US = UNIX_AT_2015_US + 10**14
NOW = stamp_at(NOW_US)
BEAT = mav.MAVLink_heartbeat_message(2, 12, 0x1D, 0, 3, 3)
IMU = mav.MAVLink_highres_imu_message(1, 0.0, 0.0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F)


def vehicle(stamp: int = NOW, key: bytes | None = KEY, link: int = 3, component: int = 1) -> mav.MAVLink:
    end = mav.MAVLink(None, 1, component)
    end.signing.secret_key, end.signing.sign_outgoing = key, key is not None
    end.signing.timestamp, end.signing.link_id = stamp, link
    return end


def packed(message=BEAT, end: mav.MAVLink | None = None, v1: bool = False) -> bytes:
    return bytes(message.pack(end or vehicle(), force_mavlink1=v1))


def plain(message=BEAT, component: int = 1) -> bytes:
    return packed(message, vehicle(key=None, component=component))


def numbered(sequence: int) -> mav.MAVLink:
    """A vehicle without a key. In MAVLink 1 the number stands where version 2 says whether it is signed."""
    end = vehicle(key=None)
    end.seq = sequence
    return end


@pytest.fixture
def signing() -> Signing:
    return Signing(KEY, NOW)


@pytest.mark.parametrize(
    "message", [BEAT, IMU, mav.MAVLink_statustext_message(6, b"a" * 50), mav.MAVLink_ping_message(0, 0, 0, 0)]
)
def test_what_pymavlink_signs_is_heard_and_the_other_way_round(signing, message):
    # Heard: the same packet as if it had never been signed
    assert signing.opened(packed(message), NOW_US) == plain(message)
    # Sent: pymavlink takes it, and refuses it once a byte is another
    end = vehicle(stamp=NOW - 1)
    end.signing.allow_unsigned_callback = None
    sent = signing.signed(plain(message, component=191), NOW_US)
    (found,) = end.parse_buffer(sent)
    assert found.get_type() == message.get_type() and end.signing.badsig_count == 0
    assert sent[-13] == 0, "the link's number"
    with pytest.raises(mav.MAVError, match="Invalid signature"):
        vehicle(stamp=NOW - 1).decode(bytearray(sent[:-1] + bytes((sent[-1] ^ 1,))))


@pytest.mark.parametrize(
    ("reason", "packets"),
    [
        (UNSIGNED, [plain()]),
        (UNSIGNED, [packed(v1=True, end=numbered(0)), packed(v1=True, end=numbered(1))]),
        (FORGED, [packed(end=vehicle(key=OTHER_KEY))]),
        (FORGED, [packed()[:-13] + bytes(13)]),
        (FORGED, [packed()[:-1] + bytes((packed()[-1] ^ 1,))]),
        (OLD, [packed(end=vehicle(stamp=NOW - MINUTE - 1))]),
    ],
)
def test_what_is_not_genuine_is_refused_and_counted_by_reason(signing, reason, packets):
    for packet in packets:
        assert signing.refusal(packet) == reason
        assert signing.opened(packet, NOW_US) == b""
    assert signing.refused == {reason: len(packets)}
    text = repr(signing) + repr(signing.refused)
    assert KEY.hex() not in text and repr(KEY) not in text


def test_a_packet_is_heard_once_and_nothing_before_it_any_more(signing):
    end = vehicle()
    first, second, third = (packed(end=end) for _ in range(3))
    assert signing.opened(second, NOW_US)
    for packet in (second, first):
        assert signing.refusal(packet) and not signing.opened(packet, NOW_US)
    assert signing.opened(third, NOW_US)
    assert signing.refused == {REPLAYED: 2}


def test_each_link_and_component_has_a_stamp_of_its_own_which_may_be_a_minute_behind_and_no_more(signing):
    assert signing.opened(packed(end=vehicle(stamp=NOW + 50)), NOW_US)
    for other in (vehicle(link=2), vehicle(component=2), vehicle(stamp=NOW - MINUTE + 50, link=1)):
        assert signing.opened(packed(end=other), NOW_US)
    assert not signing.opened(packed(end=vehicle(stamp=NOW - MINUTE - 1, link=4)), NOW_US)
    # An hour later by the clock alone
    hour_us = 3_600_000_000
    assert not signing.opened(packed(end=vehicle(link=5)), NOW_US + hour_us)
    assert signing.refused == {OLD: 2}


def test_a_forged_packet_from_the_future_locks_nobody_out(signing):
    # Given a packet of the last possible stamp, signed with no key, and one with another
    for key in (bytes(32), OTHER_KEY):
        assert not signing.opened(packed(end=vehicle(stamp=2**48 - 2, key=key)), NOW_US)
    # Then the vehicle's next is heard, and what is sent is not of the future
    assert signing.opened(packed(end=vehicle(stamp=NOW + 1)), NOW_US)
    assert signing.stamp == NOW + 1


def test_what_is_sent_is_later_than_all_sent_and_heard_whatever_the_clock_says(signing):
    stamps = []
    for now_us in (NOW_US, NOW_US, NOW_US + 500, 0, NOW_US + 100):
        stamps.append(int.from_bytes(signing.signed(plain(), now_us)[-12:-6], "little"))
    signing.opened(packed(end=vehicle(stamp=NOW + 10_000)), NOW_US)
    stamps.append(int.from_bytes(signing.signed(plain(), 0)[-12:-6], "little"))
    assert stamps == sorted(set(stamps)) and stamps[-1] == NOW + 10_001
    assert stamps[2] == NOW + 51, "500 us are 50 steps of 10"


def test_what_lasts_is_told_once_a_run_with_the_last_of_it(signing):
    def hear(packet: bytes, now_us: int) -> str | None:
        signing.opened(packet, now_us)
        return signing.news()

    told = [hear(plain(), NOW_US + step * LASTING_US // 4) for step in range(12)]
    assert [text for text in told if text] == [
        "packets without a signature are refused: 5 so far, the last HEARTBEAT of system 1, component 1"
    ]
    wrong = packed(end=vehicle(key=OTHER_KEY))
    assert [hear(wrong, NOW_US + step * LASTING_US) for step in range(2)] == [None, None], "two of them are no run"


@settings(max_examples=300, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from(
                [plain(), packed(v1=True, end=vehicle(key=None)), packed(end=vehicle(key=OTHER_KEY)), packed()[:20]]
            ),
        ),
        max_size=12,
    )
)
def test_whatever_arrives_only_genuine_packets_are_heard(pieces):
    # Given anything in pieces, and genuine packets between them
    signing, end, reader = Signing(KEY, NOW), vehicle(), Decoder()
    heard = []
    for piece in [*pieces, b"\0" * 300]:
        heard += reader.feed(signing.opened(piece + packed(end=end), NOW_US))
    heard += reader.feed(signing.opened(b"\0" * 300, NOW_US))
    # Then each of those arrives, and nothing else
    assert [packet for packet, _ in heard] == [plain()] * (len(pieces) + 1)
