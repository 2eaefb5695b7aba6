"""MAVProxy as a person uses it: parameters, modes, arming, takeoff and landing, over TCP.

MAVPROXY names its program; it lives in an environment of its own.
"""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from simulator import simulator, wait_until

MAVPROXY = os.environ.get("MAVPROXY", "mavproxy.py")


class Console:
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


def mission_file(folder: Path) -> Path:
    """Takeoff, a point 15 m to the north, and landing there, in QGroundControl's format."""
    rows = [(0, 22, 47.397742, 8.545594, 4), (0, 16, 47.397877, 8.545594, 4), (0, 21, 47.397877, 8.545594, 0)]
    lines = [
        f"{number}\t{int(number == 0)}\t3\t{command}\t{hold}\t0\t0\t0\t{latitude}\t{longitude}\t{height}\t1"
        for number, (hold, command, latitude, longitude, height) in enumerate(rows)
    ]
    path = folder / "mission.txt"
    path.write_text("\n".join(["QGC WPL 110", *lines]) + "\n")
    return path


def test_it_loads_a_mission_and_flies_it(tmp_path):
    with simulator() as simulated, mavproxy(f"tcp:127.0.0.1:{simulated.tcp_port}", tmp_path) as console:
        console.expect("Received", 60)
        # Its own `mode` fails on every PX4, whose mode numbers are triples: "required argument is not a float"
        console.type("long DO_SET_MODE 1 4 3 0 0 0 0")
        console.expect("DO_SET_MODE: ACCEPTED", 20)
        console.type(f"wp load {mission_file(tmp_path)}")
        console.expect("Loaded 3 waypoints", 20)
        console.expect("Sent all 3 waypoints", 30)
        console.type("arm throttle")
        console.expect("ARMED", 20)
        console.type("long DO_SET_MODE 1 4 4 0 0 0 0")
        console.expect("Takeoff detected", 20)
        console.expect("Disarmed by landing", 120)
