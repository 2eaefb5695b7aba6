"""MAVProxy as a person uses it: parameters, modes, arming, takeoff and landing, over UDP and TCP.

MAVPROXY names its program; it lives in an environment of its own.
"""

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from simulator import simulator, wait_until

MAVPROXY = os.environ.get("MAVPROXY", "mavproxy.py")


class Console:
    """Its input and all that it has printed."""

    def __init__(self, process: subprocess.Popen, output: Path) -> None:
        self._process = process
        self._output = output

    @property
    def text(self) -> str:
        return self._output.read_text(errors="replace")

    def type(self, line: str) -> None:
        self._process.stdin.write(line.encode() + b"\n")
        self._process.stdin.flush()

    def expect(self, words: str, seconds: float) -> None:
        wait_until(lambda: words in self.text, seconds, words)


@contextmanager
def mavproxy(address: str, folder: Path) -> Iterator[Console]:
    output = folder / "console.txt"
    with output.open("wb") as sink:
        process = subprocess.Popen(
            [MAVPROXY, f"--master={address}", "--source-system=255", "--force-connected"],
            stdin=subprocess.PIPE,
            stdout=sink,
            stderr=sink,
            cwd=folder,
        )
        try:
            yield Console(process, output)
        finally:
            process.kill()
            process.wait(10)


@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_it_connects_takes_off_and_lands(kind, tmp_path):
    with simulator() as simulated:
        address = {"udp": f"udpin:127.0.0.1:{simulated.companion_port}", "tcp": f"tcp:127.0.0.1:{simulated.tcp_port}"}
        with mavproxy(address[kind], tmp_path) as console:
            console.expect("Received", 60)
            console.type("mode LOITER")
            console.expect("LOITER", 20)
            console.type("arm throttle")
            console.expect("ARMED", 20)
            console.type("mode TAKEOFF")
            console.expect("Takeoff detected", 20)
            time.sleep(6)
            console.type("mode LAND")
            console.expect("Disarmed by landing", 60)
