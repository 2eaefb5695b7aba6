"""A tap on the wire between a simulator and a client, as a process of its own: every datagram with its time.

    python tap.py FILE LISTEN_PORT CLIENT_PORT

The simulator sends to the first port, the client listens on the second. Each record: nanoseconds of the monotonic clock
(which all processes share), 0 for a datagram from the vehicle or 1 for one to it, its length, its bytes. From the
vehicle: the time just before it goes on; to the vehicle: the time at which it came.
"""

import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RECORD = struct.Struct("<QBH")
FROM_VEHICLE, TO_VEHICLE = 0, 1


@dataclass(frozen=True)
class Datagram:
    time_s: float
    is_from_vehicle: bool
    content: bytes


@contextmanager
def tapped(file: Path, listen_port: int, client_port: int) -> Iterator[None]:
    command = [sys.executable, __file__, str(file), str(listen_port), str(client_port)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None and process.stdout is not None
    try:
        assert process.stdout.readline() == b"ready\n"
        yield
    finally:
        process.stdin.close()
        process.wait(10)


def read(file: Path) -> Iterator[Datagram]:
    content, place = file.read_bytes(), 0
    while place + RECORD.size <= len(content):
        time_ns, direction, length = RECORD.unpack_from(content, place)
        place += RECORD.size
        yield Datagram(time_ns * 1e-9, direction == FROM_VEHICLE, content[place : place + length])
        place += length


def messages(file: Path) -> Iterator[tuple[float, bool, Any]]:
    """Each MAVLink message with the time of its datagram."""
    from pymavlink.dialects.v20 import development as dialect

    parsers = {True: dialect.MAVLink(None), False: dialect.MAVLink(None)}
    for parser in parsers.values():
        parser.robust_parsing = True
    for datagram in read(file):
        for message in parsers[datagram.is_from_vehicle].parse_buffer(bytearray(datagram.content)) or []:
            yield datagram.time_s, datagram.is_from_vehicle, message


def _relay(file: Path, listen_port: int, client_port: int) -> None:
    to_simulator = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    to_client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    to_simulator.bind(("127.0.0.1", listen_port))
    to_client.connect(("127.0.0.1", client_port))
    # A refused datagram's error can be reported to the send, and then there is nothing to receive.
    to_client.setblocking(False)
    print("ready", flush=True)
    simulator: Any = None
    with file.open("wb") as record:
        while True:
            for ready in select.select([to_simulator, to_client, sys.stdin], [], [])[0]:
                if ready is sys.stdin:
                    return
                if ready is to_simulator:
                    content, simulator = to_simulator.recvfrom(65536)
                    now_ns, direction = time.monotonic_ns(), FROM_VEHICLE
                    try:
                        to_client.send(content)
                    except ConnectionRefusedError:
                        continue  # the client is not there yet
                else:
                    try:
                        content = to_client.recv(65536)
                    except (ConnectionRefusedError, BlockingIOError):
                        continue
                    now_ns, direction = time.monotonic_ns(), TO_VEHICLE
                    if simulator is not None:
                        to_simulator.sendto(content, simulator)
                record.write(RECORD.pack(now_ns, direction, len(content)) + content)


if __name__ == "__main__":
    _relay(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
