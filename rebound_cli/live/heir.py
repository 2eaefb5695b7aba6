"""A process beside the companion that says its last word when the companion is no more.

It has nothing but that word: the packet, and a duplicate of the descriptor that it would have gone by. The channel
between the two closes when the companion ends, however it ends.
"""

import json
import os
import socket
import subprocess
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from companion.shell.connection import Connection

# A link that loses a packet in ten loses one word in a thousand.
TIMES, APART_S = 3, 0.02
_MOST_BYTES = 4096


class Heir:
    """Without a word it ends with the companion and says nothing."""

    def __init__(self) -> None:
        self._channel, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._channel.setblocking(False)
        # This file is all that it needs. In a session of its own it hears no Ctrl-C.
        command = [sys.executable, "-I", "-S", __file__, str(its.fileno())]
        self._process = subprocess.Popen(command, pass_fds=[its.fileno()], start_new_session=True)
        its.close()
        self._has_word = False

    def hear(self, word: bytes, connection: "Connection") -> None:
        """The newest word, empty for none. Nobody is waited for, and nothing is raised."""
        way = connection.way(word) if word else None
        if way is None and not self._has_word:
            return
        self._has_word = way is not None
        with suppress(OSError):
            if way is None:
                self._channel.send(b"null")
            else:
                said = json.dumps([way.packet.hex(), way.address]).encode()
                socket.send_fds(self._channel, [said], [way.descriptor])

    def close(self) -> None:
        """The companion ends by itself: there is no word."""
        self._channel.setblocking(True)
        with suppress(OSError):
            self._channel.send(b"null")
        self._channel.close()
        self._process.wait()


def serve(channel: socket.socket) -> None:
    """Hear words until the companion has ended, and say the last one."""
    word: list[Any] | None = None  # a packet and where it goes
    descriptor = -1
    while True:
        said, descriptors, _, _ = socket.recv_fds(channel, _MOST_BYTES, 1)
        if not said:
            break
        if descriptor >= 0:
            os.close(descriptor)
        word, descriptor = json.loads(said), descriptors[0] if descriptors else -1
    packet, address = word or ("", None)
    for _ in range(TIMES if packet else 0):
        with suppress(OSError):
            if address is None:
                os.write(descriptor, bytes.fromhex(packet))
            else:
                socket.socket(fileno=os.dup(descriptor)).sendto(bytes.fromhex(packet), tuple(address))
        time.sleep(APART_S)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
