"""`rebound sim` paused as a job of the shell is."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import development as dialect

from tests.rebound_cli.command import start

pytestmark = pytest.mark.realtime

TIMEOUT_S = 20.0


@contextmanager
def simulated(*options: str) -> Iterator[tuple[socket.socket, int]]:
    """Where its packets arrive, and its process."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.bind(("127.0.0.1", 0))
        client.settimeout(TIMEOUT_S)
        process = start("sim", "--port", "0", "--remote", f"127.0.0.1:{client.getsockname()[1]}", *options)
        try:
            yield client, process.pid
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            process.communicate(timeout=TIMEOUT_S)


def stamps_s(client: socket.socket, count: int) -> list[float]:
    """The vehicle's time in its next inertial samples."""
    parser, stamps = dialect.MAVLink(None), []
    while len(stamps) < count:
        message = parser.decode(bytearray(client.recv(2048)))
        if message.get_type() == "HIGHRES_IMU":
            stamps.append(message.time_usec / 1e6)
    return stamps


def test_a_stopped_job_is_a_pause_after_which_it_goes_on_where_it_stood():
    with simulated() as (client, pid):
        last_s = stamps_s(client, 5)[-1]
        os.kill(pid, signal.SIGSTOP)
        client.settimeout(1.0)
        with pytest.raises(TimeoutError):
            while True:
                last_s = stamps_s(client, 1)[0]
        client.settimeout(TIMEOUT_S)
        os.kill(pid, signal.SIGCONT)
        stamps = stamps_s(client, 20)
    # Of a second's samples none is left out between what was sent before and what is sent now
    assert stamps[0] - last_s < 0.03
    assert max(later - earlier for earlier, later in pairwise(stamps)) < 0.03
