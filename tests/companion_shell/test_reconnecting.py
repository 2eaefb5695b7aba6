"""A stream that ended is there again within a second of the other end's return, and nothing waits for it meanwhile."""

import contextlib
import os
import pty
import socket
import time
from pathlib import Path

import pytest

from companion.errors import ConnectionSetupError
from companion.shell.connections import streams
from companion.shell.connections.addresses import open_connection
from companion.shell.connections.streams import RETRY_S

LOCAL = "127.0.0.1"
# A test that fails waits so long; one that passes takes an attempt or two. A busy machine keeps a thread for seconds.
DEADLINE_S = 20.0
# The loop's own patience: no call may keep a setpoint from leaving.
TICK_S = 0.02


def until(connection, is_so):
    """What came until then; all news are gathered."""
    received, news, started_s = b"", [], time.monotonic()
    while not is_so(received, news):
        assert time.monotonic() - started_s < DEADLINE_S, f"{received!r} {news}"
        received += connection.receive(TICK_S)
        connection.send(b"setpoint")
        text = connection.news()
        news += [] if text is None else [text]
    return received, news


def until_heard(connection):
    return until(connection, lambda received, _: received)[0]


def until_told(connection, word):
    (*_, text) = until(connection, lambda _, news: news and word in news[-1])[1]
    return text


def through_attempts(connection):
    """As long as two attempts that find nobody."""
    until_s = time.monotonic() + 2 * RETRY_S
    until(connection, lambda *_: time.monotonic() > until_s)
    assert connection.counts.reconnects == 0


@pytest.fixture
def closing():
    with contextlib.ExitStack() as given:
        yield lambda one: given.enter_context(contextlib.closing(one))


class Line:
    """A serial line by a pseudo-terminal; `link` is udev's name for the vehicle at its end."""

    def __init__(self, link: Path):
        self._controller, self._device = pty.openpty()
        self.path = os.ttyname(self._device)
        link.unlink(missing_ok=True)
        link.symlink_to(self.path)

    def say(self, content):
        os.write(self._controller, content)

    def hears(self):
        return os.read(self._controller, 4096)

    def close(self):
        if self._controller >= 0:
            os.close(self._device)
            os.close(self._controller)
        self._controller = -1


@pytest.fixture
def by_id(tmp_path, monkeypatch):
    folder = tmp_path / "by-id"
    folder.mkdir()
    monkeypatch.setattr(streams, "SERIAL_BY_ID", folder)
    return folder


def test_a_serial_device_is_found_again_under_another_name(tmp_path, by_id, closing):
    # Given a vehicle on a device that was given by its path
    link, path = by_id / "usb-3D_Robotics_PX4_FMU_v5-if00", tmp_path / "ttyACM0"
    line = closing(Line(link))
    path.symlink_to(line.path)
    connection = closing(open_connection(f"serial://{path}:115200"))
    raw = b"\xfd\x00\x11\x13\x0a"  # 0x11 and 0x13 would be eaten by software flow control
    line.say(raw)
    assert until_heard(connection) == raw
    # When it is unplugged
    link.unlink()
    line.close()
    assert until_told(connection, "lost") == f"connection to {path} lost, reconnecting"
    # And somebody else's device has the old one's path for some attempts, then it comes back as another
    others = closing(Line(by_id / "usb-somebody-elses"))
    path.unlink()
    path.symlink_to(others.path)
    through_attempts(connection)
    again = closing(Line(link))
    # Then bytes pass again, both ways
    assert until_told(connection, "again").endswith(f" s: {link}")
    again.say(b"after")
    assert until_heard(connection) == b"after" and b"setpoint" in again.hears()
    assert connection.counts.reconnects == 1


def test_whoever_waits_begins_without_a_device(by_id, closing):
    # Given a Pixhawk that is not plugged in
    link = by_id / "usb-3D_Robotics_PX4_FMU_v5-if00"
    connection = closing(open_connection(f"serial://{link}:115200", waits=True))
    assert until_told(connection, "Waiting") == (
        f"Serial port {link} does not exist: is the cable plugged in? Waiting for it."
    )
    through_attempts(connection)
    # When it is, then bytes pass, and no reconnect is counted
    line = closing(Line(link))
    assert until_told(connection, "connected") == f"connected: {link}"
    line.say(b"first")
    assert until_heard(connection) == b"first" and connection.counts.reconnects == 0


def test_a_setpoint_to_a_line_that_has_just_gone_is_lost_and_no_error(by_id, closing):
    line = closing(Line(by_id / "usb-3D_Robotics_PX4_FMU_v5-if00"))
    connection = closing(open_connection(f"serial://{line.path}:115200"))
    line.close()
    connection.send(b"setpoint")
    assert "lost" in until_told(connection, "lost")


def test_of_two_programs_on_a_port_the_second_is_refused_or_waits(by_id, closing):
    line = closing(Line(by_id / "usb-3D_Robotics_PX4_FMU_v5-if00"))
    first = open_connection(f"serial://{line.path}:115200")
    with pytest.raises(ConnectionSetupError, match="in use by another program"):
        open_connection(f"serial://{line.path}:115200")
    second = closing(open_connection(f"serial://{line.path}:115200", waits=True))
    first.close()
    assert until_told(second, "connected") == f"connected: {line.path}"


def test_a_port_that_may_not_be_opened_is_reported_at_once_to_whoever_waits(tmp_path):
    # Waiting gives nobody the rights to a device; here it is a folder
    with pytest.raises(ConnectionSetupError, match="cannot be opened"):
        open_connection(f"serial://{tmp_path}:115200", waits=True)


def test_a_port_whose_driver_does_not_return_is_waited_for_by_nobody(by_id, closing, monkeypatch):
    # Given a driver that keeps whoever opens the port until something is written into a pipe
    waiting, going_on = os.pipe()
    link = by_id / "vehicle"
    line = closing(Line(link))
    opens = streams.SerialConnection._device
    monkeypatch.setattr(streams.SerialConnection, "_device", lambda line: os.read(waiting, 1) and opens(line))
    os.write(going_on, b"1")
    connection = closing(open_connection(f"serial://{line.path}:115200"))
    line.close()
    until_told(connection, "lost")
    again = closing(Line(link))
    # Then the loop goes on meanwhile, tick by tick
    ticks = iter(range(20))
    until(connection, lambda *_: next(ticks, None) is None)
    assert connection.counts.reconnects == 0
    # And it is there as soon as the driver is
    os.write(going_on, b"1")
    until_told(connection, "again")
    again.say(b"after")
    assert until_heard(connection) == b"after"
    for descriptor in (waiting, going_on):
        os.close(descriptor)


def test_a_router_that_was_restarted_is_connected_to_again(closing):
    # Given a client of a router
    listener = closing(socket.create_server((LOCAL, 0)))
    port = listener.getsockname()[1]
    connection = closing(open_connection(f"tcpout://{LOCAL}:{port}"))
    router, _ = listener.accept()
    # When the router is stopped, and nobody listens for some attempts
    router.shutdown(socket.SHUT_WR)
    listener.close()
    assert until_told(connection, "lost") == f"connection to {LOCAL}:{port} lost, reconnecting"
    through_attempts(connection)
    # Then this end has closed the old connection, too
    router.settimeout(DEADLINE_S)
    while router.recv(4096):
        pass
    router.close()
    # And is started again
    listener = closing(socket.create_server((LOCAL, port)))
    # Then bytes pass again, both ways
    until_told(connection, "again")
    router = closing(listener.accept()[0])
    connection.send(b"setpoint")
    router.sendall(b"after")
    assert until_heard(connection) == b"after" and router.recv(8) == b"setpoint"
    assert connection.counts.reconnects == 1


def test_a_client_that_closed_is_followed_by_the_next_at_once(closing):
    # Given a server that has had no client yet, which is no reconnect
    server = closing(open_connection(f"tcpin://{LOCAL}:0"))
    with socket.create_connection((LOCAL, server._listener.getsockname()[1])) as first:
        first.sendall(b"first")
        assert until_heard(server) == b"first" and server.counts.reconnects == 0
    # When it goes and another comes
    second = closing(socket.create_connection((LOCAL, server._listener.getsockname()[1])))
    second.sendall(b"second")
    # Then that one is heard and answered
    assert until_heard(server) == b"second" and server.counts.reconnects == 1
    assert second.recv(8) == b"setpoint"


def test_a_host_that_acknowledges_nothing_is_given_up_within_a_second_and_no_packet_waits_for_another(closing):
    # The kernel is asked for it: a vehicle that went down without a word sends no end of its connection
    listener = closing(socket.create_server((LOCAL, 0)))
    client = closing(open_connection(f"tcpout://{LOCAL}:{listener.getsockname()[1]}"))
    with socket.socket(fileno=os.dup(client._stream.port.fileno())) as same:
        assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1000
        assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
