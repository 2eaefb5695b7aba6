"""From a hit's datagram to the setpoint on the wire, in real time at 250 Hz, quiet and beside two busy loops.

Rebound beside the least that a program can do on pymavlink and on MAVSDK (peers.py), in one run.
"""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from bench.campaign.plan import Json
from bench.faults.latency import BUSY_LOOPS, LEAD, Recorded, busy, exchanged, recorded, spread, timed
from bench.faults.packets import IMU, decoded
from bench.speed.peers import PEERS
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of

OURS = "Rebound"
_FLIGHTS = 5
# Heartbeats come once a second; MAVSDK has found the vehicle after one, and then asks for what it wants to know.
_GREETED_S = 4.0
_INTERVAL_S = 0.004

Answers = Callable[[Recorded, int], Iterator[float | None]]


def compared(hits: int) -> dict[str, dict[str, Json]]:
    """By program, quiet and busy: how the milliseconds of so many hits are spread."""
    flights = [recorded(number) for number in range(_FLIGHTS)]
    times = -(-hits // _FLIGHTS)
    programs: dict[str, Answers] = {OURS: timed} | {name: of_peer(name) for name in PEERS}

    def measured(answers: Answers) -> Json:
        return spread([taken for flight in flights for taken in answers(flight, times)])

    found = {name: {"quiet": measured(answers)} for name, answers in programs.items()}
    with busy(BUSY_LOOPS):
        for name, answers in programs.items():
            found[name]["busy"] = measured(answers)
    return found


def of_peer(name: str) -> Answers:
    """How it answers the hits of a flight: each is played to it again."""

    def answers(flight: Recorded, times: int) -> Iterator[float | None]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours, _peer(name, flight) as theirs:
            ours.bind(("127.0.0.1", 0))
            _play(flight, flight.hit - LEAD - round(_GREETED_S / _INTERVAL_S), ours, theirs)
            for _ in range(times):
                # The answer to the hit before is over when the setpoint is the calm one again.
                _play(flight, flight.hit - 2 * LEAD, ours, theirs)
                yield exchanged(flight, flight.hit - LEAD, ours, theirs)

    return answers


@contextmanager
def _peer(name: str, flight: Recorded) -> Iterator[tuple[str, int]]:
    """Its process, and where it is heard."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "bench.speed.peers", name, str(port), str(_stamp_us(flight))]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield "127.0.0.1", port
    finally:
        process.kill()
        process.wait()


def _stamp_us(flight: Recorded) -> int:
    """Of the sample that comes with the hit."""
    for frame, _ in Decoder().feed(flight.said[flight.hit]):
        if message_id_of(frame) == IMU:
            message = decoded(frame)
            assert message is not None, "the vehicle's own"
            return int(message.time_usec)
    raise AssertionError("a hit is found in a sample of the IMU")


def _play(flight: Recorded, start: int, ours: socket.socket, theirs: tuple[str, int]) -> None:
    """What the vehicle said up to shortly before the hit, at its pace; what comes back is passed over."""
    began_s = time.monotonic()
    for number, interval in enumerate(range(max(start, 0), flight.hit - LEAD)):
        time.sleep(max(began_s + number * _INTERVAL_S - time.monotonic(), 0.0))
        ours.sendto(flight.said[interval], theirs)
    ours.setblocking(False)
    with suppress(BlockingIOError):
        while True:
            ours.recv(65_536)


def table(found: dict[str, dict[str, Json]]) -> Iterator[str]:
    """Milliseconds."""
    yield "| program | | setpoints | p50, ms | p99, ms | p99.9, ms | most, ms |"
    yield "|---|---|---|---|---|---|---|"
    for name, states in found.items():
        for state, row in states.items():
            times = " | ".join(f"{row[key]:.2f}" for key in ("p50", "p99", "p999", "most"))
            yield f"| {name} | {state} | {row['found']} | {times} |"
    yield ""
