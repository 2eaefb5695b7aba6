"""Addresses on real sockets and a pseudo terminal; whose datagrams are heard, and who is answered."""

import os
import pty
import socket
import tty
from unittest.mock import Mock

import pytest

from bench.fly.packets import made
from companion.errors import ConnectionSetupError
from companion.shell.connections import streams
from companion.shell.connections.addresses import open_connection, parsed
from companion.shell.connections.connection import MOST_DATAGRAMS, UdpConnection, bound_socket, udp_in
from companion.shell.connections.peer import RELEASED_US, Peer
from companion.shell.connections.streams import Stream

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
    unknown = IMU[:7] + b"\xa3\0\0" + IMU[10:]
    assert peer.accepts(IMU + unknown + HEARTBEAT, VEHICLE, 0)
    for datagram in (b"\0", IMU, HEARTBEAT):
        assert not peer.accepts(datagram, STRANGER, 1)
    assert (peer.answered, peer.counts.stranger_datagrams) == (VEHICLE, 3)
    assert "10.0.0.66:4444" in peer.news.pop() and not peer.news, "told once"


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
        assert (peer.answered, peer.counts.reconnects) == (moved, 1)
        assert f"now sends from {moved[0]}:{moved[1]}" in peer.news.pop()


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
    # Given packets of which one is genuine
    genuine, forged = (made("HEARTBEAT", OF_PX4, number=number) for number in (0, 1))
    peer, moved = Peer(signing=Mock(refusal={genuine: None, forged: "forged"}.get)), ("192.168.4.1", 50_001)
    # Then a forged heartbeat pins nothing
    peer.accepts(forged, STRANGER, 0)
    assert peer.accepts(forged, VEHICLE, 0)
    assert peer.accepts(genuine, VEHICLE, 1) and peer.answered == VEHICLE
    assert not peer.accepts(genuine, STRANGER, 2)
    # And with the vehicle's address alone nobody holds its place once it has moved, nor takes it
    assert peer.accepts(forged, VEHICLE, 2 * RELEASED_US)
    assert not peer.accepts(forged, moved, 2 * RELEASED_US) and peer.answered == VEHICLE
    assert peer.accepts(genuine, moved, 2 * RELEASED_US) and peer.answered == moved


def test_a_stranger_without_the_key_is_not_answered_in_the_place_of_a_vehicle_whose_time_is_old():
    # Given a vehicle that has the key, its time stamp old until it has heard the companion
    peer = Peer(signing=Mock(refusal=lambda packet: "old", is_signed=lambda packet: packet == HEARTBEAT))
    peer.accepts(HEARTBEAT, VEHICLE, 0)
    # When somebody without the key sends more often
    peer.accepts(IMU, STRANGER, 1)
    # Then the vehicle is answered
    assert peer.answered == VEHICLE


LOCAL = "127.0.0.1"


@pytest.fixture
def peer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind((LOCAL, 0))
        bound.settimeout(2)
        yield bound


def test_udpin_answers_the_vehicle_one_packet_a_datagram_whoever_else_sends(peer):
    # Given a listening connection and a vehicle that sent first
    connection = udp_in(LOCAL, 0)
    peer.sendto(HEARTBEAT, (LOCAL, connection.local_port))
    assert connection.receive(2.0) == HEARTBEAT
    # When two packets are sent
    connection.send(b"one")
    connection.send(b"two")
    # Then each arrives as a datagram of its own
    assert [peer.recv(100), peer.recv(100)] == [b"one", b"two"]
    # And a stranger's byte, or heartbeat, diverts nothing
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for content in (b"\0", HEARTBEAT):
            other.sendto(content, (LOCAL, connection.local_port))
            assert connection.receive(2.0) == b""
            connection.send(b"three")
            assert peer.recv(100) == b"three"
        assert f"{LOCAL}:{other.getsockname()[1]} sends to this port, too" in connection.news()
    connection.close()


def test_all_that_has_arrived_is_received_at_once_but_who_sends_without_end_keeps_nobody(peer):
    # Given a socket in which more datagrams wait than are taken in one step
    with bound_socket(socket.SOCK_DGRAM, LOCAL, 0) as opened:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 212_992)
        for _ in range(MOST_DATAGRAMS + 20):
            peer.sendto(HEARTBEAT, opened.getsockname())
        connection = UdpConnection(opened, Peer())
        assert connection.receive(2.0) == HEARTBEAT * MOST_DATAGRAMS
        assert connection.receive(2.0) == HEARTBEAT * 20


def test_udpin_with_a_peer_named_hears_that_one_alone(peer):
    connection = open_connection(f"udpin://{LOCAL}:0", f"{LOCAL}:{peer.getsockname()[1]}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(HEARTBEAT, (LOCAL, connection.local_port))
        assert connection.receive(2.0) == b""
        peer.sendto(HEARTBEAT, (LOCAL, connection.local_port))
        assert connection.receive(2.0) == HEARTBEAT
    connection.close()


@pytest.mark.parametrize("host", ["", "0.0.0.0", "[::]"])
def test_the_older_form_listens_where_it_names_no_host(host):
    assert parsed(f"udp://{host}:14540")[1:] == ("udpin", host, 14540)


@pytest.mark.parametrize("scheme", ["udpout", "udp"])
def test_udpout_sends_first_and_hears_only_the_address_it_speaks_to(peer, scheme):
    connection = open_connection(f"{scheme}://{LOCAL}:{peer.getsockname()[1]}")
    connection.send(b"first")
    content, address = peer.recvfrom(100)
    assert content == b"first"
    # When somebody else finds its port, on the same host and with a vehicle's heartbeat
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(HEARTBEAT, address)
        # Then that is not heard, but told and counted
        assert connection.receive(2.0) == b""
        assert f"{LOCAL}:{other.getsockname()[1]} sends to this port, too" in connection.news()
    assert connection.counts.stranger_datagrams == 1
    # And diverts nothing
    connection.send(b"second")
    assert peer.recv(100) == b"second"
    peer.sendto(HEARTBEAT, address)
    assert connection.receive(2.0) == HEARTBEAT
    connection.close()


def test_the_beginning_of_a_packet_is_kept_until_the_rest_has_come(monkeypatch):
    # Given a line whose driver hands on what it has, on which a byte takes 10 ms
    rests_s = []
    monkeypatch.setattr(streams.time, "sleep", rests_s.append)
    far, near = pty.openpty()
    os.set_blocking(far, False)
    tty.setraw(near)
    with os.fdopen(near, "rb", buffering=0) as port:
        stream = Stream(port, "the line", byte_s=0.01)
        # When a packet and the beginning of the next come, then the rest with a beginning of two bytes
        os.write(far, HEARTBEAT + HEARTBEAT[:7])
        assert stream.receive(1.0) == HEARTBEAT and stream.receive(0.0) == b""
        os.write(far, HEARTBEAT[7:] + HEARTBEAT[:2])
        # Then each packet comes whole
        assert stream.receive(1.0) == HEARTBEAT and stream.receive(0.0) == b""
        # And where seven bytes were lost, the next packet comes at once with what is left of this one
        os.write(far, HEARTBEAT[9:] + HEARTBEAT)
        assert stream.receive(1.0) == HEARTBEAT[:2] + HEARTBEAT[9:] + HEARTBEAT
        # Nobody is woken for a piece: what is missing, as far as that is known, is slept through while there is time
        os.write(far, HEARTBEAT[:7])
        assert stream.receive(0.1) == b""
        assert rests_s == [pytest.approx(0.01 * len(HEARTBEAT[7:])), 0.01, pytest.approx(0.05, abs=0.05)]
    os.close(far)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        # Other programs' habits are answered with what is wanted
        ("udp:127.0.0.1:14550", "is not a connection address: use udpin://"),
        ("99999", "is not a connection address: use udpin://"),
        ("/dev/ttyUSB0:fast", "is not a connection address: use udpin://"),
        ("mavlink://x:1", "mavlink"),
        ("udpin://0.0.0.0", "udpin"),
        ("udpin://0.0.0.0:99999", "there is no port 99999, the last is 65535."),
        ("udpout:127.0.0.1:70000", "use udpin://"),
        ("udpout://127.0.0.1:0", "remote host and port"),
        ("udpout://0.0.0.0:14580", "to listen, use udpin://0.0.0.0:14580"),
        ("udp://0:14580", "to listen, use udpin://0:14580"),
        ("tcpout://0.0.0.0:5760", "to listen, use tcpin://0.0.0.0:5760"),
        ("udpout://255.255.255.255:14580", "many hosts"),
        ("udpout://224.0.0.1:14580", "many hosts"),
        ("udpout://nobody.invalid:14580", "Host 'nobody.invalid' is unknown"),
        ("udpout://:14580", "remote host"),
        ("serial:///dev/ttyS0", "baud"),
        ("serial:///dev/does-not-exist:57600", "/dev/does-not-exist does not exist"),
        ("serial:///dev/null:57600", "/dev/null"),
        ("udpin://203.0.113.9:14540", "203.0.113.9"),
        (f"tcpout://{'a' * 64}.de:5760", "a.de"),
        ("serial:///dev/null:5\N{SUPERSCRIPT TWO}", "baud"),
        ("serial:///dev/null:4000000000", "baud"),
        # An address, and the peer that is heard there alone
        ("udpout://127.0.0.1:9 127.0.0.1", "--peer 127.0.0.1 is for udpin"),
        ("udp://127.0.0.1:9 127.0.0.1", "--peer 127.0.0.1 is for udpin"),
        ("serial:///dev/null:57600 127.0.0.1", "--peer 127.0.0.1 is for udpin"),
        ("udpin://127.0.0.1:0 no such", "Host 'no such' is unknown"),
        ("udpin://127.0.0.1:0 ::1", "Host '::1' is unknown"),
    ],
)
def test_a_bad_address_is_one_sentence_that_names_the_fault(words, named):
    with pytest.raises(ConnectionSetupError) as caught:
        open_connection(*words.split(" ", 1))
    text = str(caught.value)
    assert named in text
    assert "\n" not in text and text.endswith((".", "?"))
