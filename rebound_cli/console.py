"""What a person sees: the live line during a flight, the timeline and the figures of each hit after it."""

import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from rebound_cli.background import Background, at_once

if TYPE_CHECKING:
    from companion.report import Event, Status

# Ten times a second looks continuous; in a file or a pipe a line every few seconds is enough to see life.
LIVE_INTERVAL_S = 0.1
PLAIN_INTERVAL_S = 5.0

_WIDEST_TEXT = 110

_ERASE_LINE = "\r\x1b[K"


class Console:
    """Text for a person, on stdout or, when stdout belongs to a program, on stderr.

    With a `writer` nothing waits for the terminal, or for the reader of a pipe, before `close`.
    """

    def __init__(self, stream: TextIO, writer: Background | None = None) -> None:
        self._stream = stream
        self.writer = writer
        self._do = at_once if writer is None else writer.give
        self.is_terminal = stream.isatty()
        self._live_due_s = 0.0
        self._live_is_shown = False
        self.live_is_held = False  # while a question waits for its answer

    def live(self, status: "Callable[[], Status]", flight_time_s: float) -> None:
        """Show the state now if a fresh line is due."""
        now_s = time.monotonic()
        if now_s < self._live_due_s or self.live_is_held:
            return
        self._live_due_s = now_s + (LIVE_INTERVAL_S if self.is_terminal else PLAIN_INTERVAL_S)
        line = live_text(status(), flight_time_s)
        if self.is_terminal:
            width = shutil.get_terminal_size().columns - 1
            self._do(self._write, _ERASE_LINE + line[:width])
            self._live_is_shown = True
        else:
            self.print(line)

    def print(self, text: str = "") -> None:
        before = _ERASE_LINE if self._live_is_shown else ""
        self._live_is_shown = False
        self._do(self._write, f"{before}{text}\n")

    def ask(self, question: str) -> None:
        """Print a question whose answer is read elsewhere; live lines wait until it has come."""
        self.print()
        self._do(self._write, question)
        self.live_is_held = True

    def close(self) -> None:
        """Return when all is shown that could be. Raises what kept the rest from it."""
        if self.writer is not None:
            self.writer.close()
            if self.writer.error is not None:
                raise self.writer.error

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def console_for(json_on_stdout: bool, writer: Background | None = None) -> Console:
    return Console(sys.stderr if json_on_stdout else sys.stdout, writer)


def live_text(status: "Status", flight_time_s: float) -> str:
    """One line of 80 columns: companion's state, vehicle's mode, local NED position, speed, detector."""
    lead = f"{flight_time_s:6.1f} s  {status.state:<10} "
    if not status.vehicle_mode:
        return lead + "no vehicle heard yet"
    mode = status.vehicle_mode if status.armed else f"{status.vehicle_mode} (disarmed)"
    position, speed_m_s = status.position_ned_m, status.speed_m_s
    where = "no position" if position is None else "{:+.2f} {:+.2f} {:+.2f} m".format(*position)
    speed = "" if speed_m_s is None else f"  {speed_m_s:.2f} m/s"
    return f"{lead} {mode}  {where}{speed}  detector {status.detector}"


def timeline(events: "Sequence[Event]", started_at_us: int) -> str:
    width = min(shutil.get_terminal_size().columns, _WIDEST_TEXT)
    lines = []
    for event in events:
        lead = f"{(event.time_us - started_at_us) / 1e6:9.3f} s  {event.kind:<10}  "
        hanging = " " * len(lead)
        lines.append(textwrap.fill(event.text, width, initial_indent=lead, subsequent_indent=hanging))
    return "\n".join(lines)
