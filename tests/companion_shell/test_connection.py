"""Connection addresses on real sockets and a pseudo terminal."""

import os
import pty
import socket
import tty

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.errors import ConnectionSetupError
from companion.shell import addresses
from companion.shell.addresses import open_connection
from companion.shell.connection import udp_in
from companion.shell.streams import Stream

LOCAL = "127.0.0.1"
HEARTBEAT = bytes(mav.MAVLink_heartbeat_message(2, 12, 0x1D, 0, 3, 3).pack(mav.MAVLink(None, 1, 1)))


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


def test_udpin_with_a_peer_named_hears_that_one_alone(peer):
    connection = open_connection(f"udpin://{LOCAL}:0", f"{LOCAL}:{peer.getsockname()[1]}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(HEARTBEAT, (LOCAL, connection.local_port))
        assert connection.receive(2.0) == b""
        peer.sendto(HEARTBEAT, (LOCAL, connection.local_port))
        assert connection.receive(2.0) == HEARTBEAT
    connection.close()


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("udpout://127.0.0.1:9", "127.0.0.1"),
        ("udp://127.0.0.1:9", "127.0.0.1"),
        ("serial:///dev/null:57600", "127.0.0.1"),
        ("udpin://127.0.0.1:0", "no such"),
        ("udpin://127.0.0.1:0", "::1"),
    ],
)
def test_a_peer_that_means_nothing_is_refused_in_one_sentence(url, named):
    with pytest.raises(ConnectionSetupError, match="--peer"):
        open_connection(url, named)


@pytest.mark.parametrize("host", ["", "0.0.0.0", "[::]"])
def test_the_older_form_listens_where_it_names_no_host(monkeypatch, host):
    monkeypatch.setattr(addresses, "udp_in", lambda host, port, _: (host, port))
    assert open_connection(f"udp://{host}:14540") == (host, 14540)


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


def test_the_beginning_of_a_packet_is_kept_until_the_rest_has_come():
    # Given a line whose driver hands on what it has
    far, near = pty.openpty()
    os.set_blocking(far, False)
    tty.setraw(near)
    with os.fdopen(near, "rb", buffering=0) as port:
        stream = Stream(port, "the line")
        # When a packet and the beginning of the next come, then the rest with a beginning of two bytes
        os.write(far, HEARTBEAT + HEARTBEAT[:7])
        assert stream.receive(1.0) == HEARTBEAT and stream.receive(0.0) == b""
        os.write(far, HEARTBEAT[7:] + HEARTBEAT[:2])
        # Then each packet comes whole
        assert stream.receive(1.0) == HEARTBEAT and stream.receive(0.0) == b""
        # And where seven bytes were lost, the next packet comes at once with what is left of this one
        os.write(far, HEARTBEAT[9:] + HEARTBEAT)
        assert stream.receive(1.0) == HEARTBEAT[:2] + HEARTBEAT[9:] + HEARTBEAT
    os.close(far)


@pytest.mark.parametrize(
    ("url", "named"),
    [
        # Other programs' habits are answered with what was meant
        ("/dev/ttyUSB0", "did you mean serial:///dev/ttyUSB0:921600?"),
        ("/dev/ttyACM0,57600", "did you mean serial:///dev/ttyACM0:57600?"),
        ("udp:127.0.0.1:14550", "did you mean udpin://127.0.0.1:14550?"),
        ("udpout:10.0.0.2:14580", "did you mean udpout://10.0.0.2:14580?"),
        ("tcp:127.0.0.1:5760", "did you mean tcpout://127.0.0.1:5760?"),
        ("192.168.1.20:14580", "did you mean udpout://192.168.1.20:14580?"),
        ("14540", "did you mean udpin://0.0.0.0:14540?"),
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
        ("udpin://..:14540", "'..' is unknown"),
        (f"tcpout://{'a' * 64}.de:5760", "a.de"),
        ("serial:///dev/null:5\N{SUPERSCRIPT TWO}", "baud"),
    ],
)
def test_a_bad_address_is_one_sentence_that_names_the_fault(url, named):
    with pytest.raises(ConnectionSetupError) as caught:
        open_connection(url)
    text = str(caught.value)
    assert named in text
    assert "\n" not in text and text.endswith((".", "?"))
