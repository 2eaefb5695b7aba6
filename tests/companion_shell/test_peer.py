"""Whose datagrams are heard on a UDP port, and who is answered."""

import pytest

from bench.fly.packets import made
from companion.shell.peer import RELEASED_US, Peer

VEHICLE, STRANGER = ("192.168.4.1", 14580), ("10.0.0.66", 4444)


OF_PX4 = {"type": 2, "autopilot": 12, "base_mode": 0x1D, "system_status": 3}
HEARTBEAT = made("HEARTBEAT", OF_PX4)
CAMERAS = made("HEARTBEAT", {"type": 30, "autopilot": 8}, (1, 100))
IMU = made("HIGHRES_IMU", {"time_usec": 1, "zacc": -9.8, "fields_updated": 0x3F})


def test_before_there_is_a_vehicle_the_last_sender_of_a_packet_is_answered():
    peer = Peer()
    assert peer.accepts(IMU, VEHICLE, 0) and peer.answered == VEHICLE
    assert peer.accepts(b"\0", STRANGER, 1) and peer.answered == VEHICLE, "one byte is no packet"
    assert peer.accepts(IMU[:-1] + b"\0", STRANGER, 2) and peer.answered == VEHICLE, "nor is a broken one"
    assert peer.accepts(CAMERAS, STRANGER, 3) and peer.answered == STRANGER


def test_the_vehicles_heartbeat_pins_its_address():
    peer = Peer()
    assert peer.accepts(IMU + HEARTBEAT, VEHICLE, 0)
    for datagram in (b"\0", IMU, HEARTBEAT):
        assert not peer.accepts(datagram, STRANGER, 1)
    assert (peer.answered, peer.dropped) == (VEHICLE, 3)
    assert "10.0.0.66:4444" in peer.news() and peer.news() is None, "told once"


@pytest.mark.parametrize(("silent_us", "is_heard"), [(490_000, False), (510_000, True)])
def test_a_strangers_heartbeat_counts_once_the_vehicle_has_been_silent_for_half_a_second(silent_us, is_heard):
    peer = Peer()
    peer.accepts(HEARTBEAT, VEHICLE, 0)
    peer.accepts(IMU, VEHICLE, 1_000_000)
    assert peer.accepts(HEARTBEAT, STRANGER, 1_000_000 + silent_us) is is_heard
    assert peer.answered == (STRANGER if is_heard else VEHICLE)


def test_a_vehicle_that_moved_is_heard_and_answered_within_a_second():
    # Given a vehicle that streams at 50 Hz with a heartbeat a second, and moves just before a heartbeat, or just after
    for first_beat_us in (10_000, 990_000):
        peer, moved = Peer(), ("192.168.4.1", 50_001)
        peer.accepts(HEARTBEAT, VEHICLE, 0)
        # When it speaks from its new address
        heard_us = None
        for now_us in range(10_000, 2_000_000, 20_000):
            beats = (now_us - first_beat_us) % 1_000_000 == 0
            if peer.accepts(HEARTBEAT if beats else IMU, moved, now_us) and heard_us is None:
                heard_us = now_us
        # Then it is answered there within the second, and told once
        assert heard_us is not None and heard_us <= 1_000_000
        assert (peer.answered, peer.moves) == (moved, 1)
        assert f"{moved[0]}:{moved[1]}" in peer.news()


def test_who_fills_a_gap_of_the_vehicles_loses_its_place_to_it():
    # Given somebody who forges heartbeats, and a vehicle that is not heard for longer than RELEASED_US
    peer = Peer()
    peer.accepts(HEARTBEAT, VEHICLE, 0)
    assert peer.accepts(HEARTBEAT, STRANGER, RELEASED_US + 1)
    # When the vehicle is heard again
    assert peer.accepts(HEARTBEAT, VEHICLE, RELEASED_US + 2)
    # Then it is answered, and the other is not believed beside it
    assert not peer.accepts(HEARTBEAT, STRANGER, RELEASED_US + 3)
    assert peer.answered == VEHICLE


def test_a_heartbeat_from_before_the_vehicle_last_spoke_moves_nothing():
    peer = Peer()
    peer.accepts(HEARTBEAT, VEHICLE, 0)
    # Given a stranger's forged heartbeat, after which the vehicle is heard once more
    peer.accepts(HEARTBEAT, STRANGER, 1)
    peer.accepts(IMU, VEHICLE, 2)
    # Then the stranger has to forge another to be heard in the vehicle's silence
    assert not peer.accepts(IMU, STRANGER, RELEASED_US + 3)
    assert peer.accepts(HEARTBEAT, STRANGER, RELEASED_US + 4)


@pytest.mark.parametrize("port", [None, VEHICLE[1]])
def test_who_was_named_is_heard_alone_before_and_after(port):
    peer = Peer((VEHICLE[0], port))
    assert not peer.accepts(HEARTBEAT, STRANGER, 0)
    assert peer.accepts(HEARTBEAT, VEHICLE, 1)
    assert not peer.accepts(HEARTBEAT, STRANGER, 10 * RELEASED_US)
    assert peer.accepts(HEARTBEAT, (VEHICLE[0], 1), 10 * RELEASED_US) is (port is None)


def test_where_packets_are_signed_only_genuine_ones_pin_hold_and_move_an_address():
    # Given packets of which those with an even sequence number are genuine
    genuine, forged = (made("HEARTBEAT", OF_PX4, number=number) for number in (0, 1))
    peer = Peer(is_genuine=lambda packet: packet[4] % 2 == 0)
    # Then a forged heartbeat pins nothing
    peer.accepts(forged, STRANGER, 0)
    assert peer.accepts(forged, VEHICLE, 0)
    assert peer.accepts(genuine, VEHICLE, 1) and peer.answered == VEHICLE
    assert not peer.accepts(genuine, STRANGER, 2)
    # And with the vehicle's address alone nobody holds its place once it has moved, nor takes it
    moved = ("192.168.4.1", 50_001)
    assert peer.accepts(forged, VEHICLE, 2 * RELEASED_US)
    assert not peer.accepts(forged, moved, 2 * RELEASED_US) and peer.answered == VEHICLE
    assert peer.accepts(genuine, moved, 2 * RELEASED_US) and peer.answered == moved


def test_a_stranger_without_the_key_is_not_answered_in_the_place_of_a_vehicle_whose_time_is_old():
    # Given a vehicle that has the key, its time stamp old until it has heard the companion
    peer = Peer(is_genuine=lambda packet: False, has_key=lambda packet: packet == HEARTBEAT)
    peer.accepts(HEARTBEAT, VEHICLE, 0)
    # When somebody without the key sends more often
    peer.accepts(IMU, STRANGER, 1)
    # Then the vehicle is answered
    assert peer.answered == VEHICLE
