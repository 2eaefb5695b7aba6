"""A process beside the companion that says its last words when the companion is no more.

It has nothing but these words, each with its time, and a duplicate of the descriptor that they would have gone by. The
channel between the two closes when the companion ends, however it ends.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from companion.shell.connections.connection import Connection

# A link that loses a packet in ten loses one word in a thousand.
TIMES, APART_S = 3, 0.02
_MOST_BYTES = 65_536


class Heir:
    """Without a word it ends with the companion and says nothing."""

    def __init__(self) -> None:
        self._channel, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._channel.setblocking(False)
        # This file is all that it needs. In a session of its own it hears no Ctrl-C.
        command = [sys.executable, "-I", "-S", __file__, str(its.fileno())]
        # Nor what systemd, or its watchdog, ends the rest of a service with (systemd.kill(5)): a mask is inherited.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGTERM, signal.SIGABRT))
        self._process = subprocess.Popen(command, pass_fds=[its.fileno()], start_new_session=True)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        its.close()
        self._has_words = False

    def hear(self, words: Sequence[tuple[float, bytes]], connection: "Connection") -> None:
        """The newest words, each so many seconds after the end. Nobody is waited for, and nothing is raised."""
        ways = [(later_s, way) for later_s, word in words if (way := connection.way(word)) is not None]
        if not ways and not self._has_words:
            return
        said = json.dumps([[later_s, way.packet.hex(), way.address] for later_s, way in ways]).encode()
        with suppress(OSError):
            # Of what could not be sent the next step tries again: words that are taken back have to be.
            socket.send_fds(self._channel, [said], [way.descriptor for _, way in ways[:1]])
            self._has_words = bool(ways)

    def close(self) -> None:
        """The companion ends by itself: there is no word."""
        with suppress(OSError):
            self._channel.setblocking(True)
            self._channel.send(b"[]")
        self.leave()

    def leave(self) -> None:
        """The companion ends in the midst of a flight: the last words are said."""
        self._channel.close()
        self._process.wait()


def serve(channel: socket.socket) -> None:
    """Hear words until the companion has ended, and say the last ones."""
    words: list[tuple[float, str, Any]] = []
    descriptor = -1
    while True:
        said, descriptors, _, _ = socket.recv_fds(channel, _MOST_BYTES, 1)
        if not said:
            break
        if descriptor >= 0:
            os.close(descriptor)
        words, descriptor = json.loads(said), descriptors[0] if descriptors else -1
    ended_s = time.monotonic()
    for later_s, packet, address in words:
        time.sleep(max(0.0, ended_s + later_s - time.monotonic()))
        for _ in range(TIMES):
            _say(bytes.fromhex(packet), descriptor, address)
            time.sleep(APART_S)


def _say(packet: bytes, descriptor: int, address: Any) -> None:
    with suppress(OSError):
        if address is None:
            os.write(descriptor, packet)
        else:
            socket.socket(fileno=os.dup(descriptor)).sendto(packet, tuple(address))


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
