"""`rebound sim` as a process of its own, for clients that know nothing of this project's code.

REBOUND_PYTHON names the interpreter in whose environment the simulator is installed; by default this one.
"""

import os
import random
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Simulator:
    companion_port: int
    """It sends here unasked, as PX4's SITL does to 14540."""
    tcp_port: int


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """Below the ports that Linux gives to sockets that ask for none: no other socket gets it before its owner does."""
    for port in random.sample(range(20_000, 32_000), 100):
        with socket.socket(socket.AF_INET, kind) as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError("no port between 20 000 and 32 000 is free")


def _rebound(*words: str, **pipes: Any) -> subprocess.Popen:
    """A command of ours, of which what it prints is read."""
    command = [os.environ.get("REBOUND_PYTHON", sys.executable), "-m", "rebound_cli", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, **pipes)


@contextmanager
def simulator(*options: str) -> Iterator[Simulator]:
    """On free ports; it ends with the block, or with this process."""
    companion, tcp = free_port(), free_port(socket.SOCK_STREAM)
    links = ["--port", "0", "--remote", f"127.0.0.1:{companion}", "--link", f"tcpin://127.0.0.1:{tcp}"]
    process = _rebound("sim", "--stop-with-stdin", *links, *options, stdin=subprocess.PIPE)
    try:
        # Before it come lines on what is compiled, where nothing has been compiled yet.
        assert any(line.startswith(b"Simulated vehicle") for line in process.stdout), "the simulator did not start"
        yield Simulator(companion, tcp)
    finally:
        process.stdin.close()
        process.wait(10)


@contextmanager
def guarded_simulator(*options: str) -> Iterator[Simulator]:
    """The same behind a guard in between, which hands everything on as the simulator itself would."""
    client, tcp = free_port(), free_port(socket.SOCK_STREAM)
    with simulator(*options) as simulated, tempfile.TemporaryDirectory() as folder:
        between = ["--between", f"tcpin://127.0.0.1:{tcp}", "--between", f"udpout://127.0.0.1:{client}"]
        vehicle = f"udpin://127.0.0.1:{simulated.companion_port}"
        process = _rebound("guard", "--out", folder, "--connect", vehicle, *between, stderr=subprocess.STDOUT)
        try:
            assert any(b"standing by" in line for line in process.stdout), "the guard did not connect"
            yield Simulator(client, tcp)
        finally:
            process.terminate()
            process.communicate(timeout=20)


def wait_until(condition, at_most_s: float, what: str) -> None:
    until_s = time.monotonic() + at_most_s
    while not condition():
        assert time.monotonic() < until_s, f"not within {at_most_s} s: {what}"
        time.sleep(0.05)
