"""What a person sees while something flies or is compiled: on a terminal, and in a pipe."""

import io
import sys

import pytest

from companion.report import Event, Status
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.timing import LinkRate
from rebound_cli.simulation.vehicle_process import VehicleProcess, VehicleProcessError

EVENTS = (Event(1_000_000, "mode", "mode OFFBOARD", {}), Event(2_500_000, "detection", "hit 1 at [3.76, 0.00]", {}))
FLYING = Status("mission", "OFFBOARD", True, (1.0, 2.0, -1.5), 2.0, "armed at 1.8 m/s^2", 4_000)
RED, ANEW = "\x1b[1;31m", "\r\x1b[K"


class Screen(io.StringIO):
    """A terminal of which every byte is kept."""

    def isatty(self):
        return True


def test_in_a_pipe_each_event_and_now_and_then_the_state_is_one_plain_line():
    stream = io.StringIO()
    with Console(stream) as console:
        console.events(EVENTS, 0)
        console.live(lambda: FLYING, 3.0, "40.1 kB/s")
        console.live(lambda: FLYING, 3.1, "40.1 kB/s")
    assert stream.getvalue().splitlines() == [
        "    1.000 s  mode        mode OFFBOARD",
        "    2.500 s  detection   hit 1 at [3.76, 0.00]",
        "      3.0 s  state mission  mode OFFBOARD  position +1.00 +2.00 -1.50 m, 2.00 m/s  "
        "detector armed at 1.8 m/s^2  round trip 4 ms  link 40.1 kB/s",
    ]


def test_on_a_terminal_the_hit_stands_out_and_brackets_are_no_markup():
    screen = Screen()
    with Console(screen) as console:
        console.live(lambda: FLYING, 3.0)
        console.events(EVENTS, 0)
    # The state is one line, which the next event takes the place of
    assert "\n" not in screen.getvalue().partition(ANEW + "    1.000 s")[0]
    other, hit = (next(line for line in screen.getvalue().splitlines() if text in line) for text in ("mode ", "hit 1"))
    assert RED in hit and "[3.76, 0.00]" in hit and RED not in other


def test_what_a_vehicle_compiles_is_told_by_who_waits_for_it_and_ctrl_c_ends_that(tmp_path, monkeypatch):
    # Given a vehicle that compiles, and then is ready
    said = "Compiling physics\nCompiled code is not kept.\nSimulated vehicle x\n"
    code = f"import sys; print({said!r}, end='', flush=True); sys.stdin.read()"
    script = tmp_path / "vehicle"
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -c "$CODE"\n')
    script.chmod(0o755)
    monkeypatch.setenv("CODE", code)
    monkeypatch.setattr(sys, "executable", str(script))
    stream = io.StringIO()
    # When somebody waits for it, then that is told
    with VehicleProcess(tmp_path, []) as vehicle:
        vehicle.wait_until_ready(Interrupts(), Console(stream))
    assert stream.getvalue() == said.rpartition("Simulated")[0]
    # And Ctrl-C before it is ready ends the wait
    interrupts = Interrupts()
    interrupts.reason = "stopped with Ctrl-C"
    with pytest.raises(VehicleProcessError, match="Ctrl-C"), VehicleProcess(tmp_path, []) as vehicle:
        vehicle.wait_until_ready(interrupts, Console(stream))


def test_the_link_is_a_rate_and_then_a_silence():
    heard = LinkRate()
    assert heard.text(500_000) == ""
    for now_us in range(1_000_000, 2_100_001, 10_000):
        heard.take(400, now_us)
    assert heard.text(2_100_000) == "40.4 kB/s"
    assert heard.text(2_900_000) == "40.4 kB/s"
    assert heard.text(4_100_000) == "silent for 2.0 s"
