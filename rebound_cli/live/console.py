"""What a person sees of a flight: events as they happen, the state now, the end."""

import os
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Self, TextIO

from rebound_cli.background import Background, at_once

if TYPE_CHECKING:
    from companion.report import Event, Status

# Ten times a second looks continuous; in a file or a pipe a line every few seconds is enough to see life.
LIVE_INTERVAL_S = 0.1
PLAIN_INTERVAL_S = 5.0
LAST_WAIT_S = 1.0
# The events that a person waits for: a hit as the companion sees it, and as the simulator knows it.
STANDING_OUT = ("detection", "hit")
# Of a terminal: back to the line's beginning and clear it; bold red, and as before.
_ANEW, _RED, _AS_BEFORE = "\r\x1b[K", "\x1b[1;31m", "\x1b[0m"


class Console:
    """Text for a person, on stdout or, when stdout belongs to a program, on stderr.

    On a terminal lines stand above the state now, which is written anew. With a `writer` nothing waits for the
    terminal, or for the reader of a pipe, before the `with` ends.
    """

    def __init__(self, stream: TextIO, writer: Background | None = None) -> None:
        self._stream, self.writer = stream, writer
        self._do = at_once if writer is None else writer.give
        self.is_terminal = stream.isatty()
        # The state is no line of a service's journal: the service manager shows the present one.
        self._is_journal = "NOTIFY_SOCKET" in os.environ
        self._live_due_s = 0.0
        self.live_is_held = False  # while a question waits for its answer

    def live(self, status: "Callable[[], Status]", flight_time_s: float, link: str = "") -> None:
        """Show the state now if that is due again."""
        now_s = time.monotonic()
        if now_s < self._live_due_s or self.live_is_held:
            return
        self._live_due_s = now_s + (LIVE_INTERVAL_S if self.is_terminal else PLAIN_INTERVAL_S)
        (_, time_text), *others = state_fields(status(), flight_time_s, link)
        line = "  ".join([f"{time_text:>11}", *(f"{name} {text}" for name, text in others)])
        if self.is_terminal:
            # One that wraps could not be cleared.
            self._put(line[: shutil.get_terminal_size().columns - 1])
        elif not self._is_journal:
            self.print(line)

    def events(self, events: "Sequence[Event]", started_at_us: int) -> None:
        for event in events:
            self.event((event.time_us - started_at_us) / 1e6, event.kind, event.text)

    def event(self, time_s: float, kind: str, text: str) -> None:
        line = f"{time_s:9.3f} s  {kind:<10}  {text}"
        self.print(f"{_RED}{line}{_AS_BEFORE}" if kind in STANDING_OUT and self.is_terminal else line)

    def print(self, text: str = "") -> None:
        self._put(f"{text}\n")

    def ask(self, question: str) -> None:
        """Print a question whose answer is read elsewhere; the state waits until it has come."""
        self._put(f"\n{question}")
        self.live_is_held = True

    def still(self) -> None:
        """Take the state away: nothing changes any more."""
        self._put("")

    def _put(self, text: str) -> None:
        """In the place of the state."""
        self._do(self._write, f"{_ANEW}{text}" if self.is_terminal else text)

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Return when all is shown that could be. Raises what kept the rest from it, unless more went wrong."""
        self.still()
        if self.writer is None:
            return
        # Whoever presses Ctrl-C twice does not wait for a terminal that has been stopped.
        self.writer.close(LAST_WAIT_S if kind is not None else None)
        if kind is None and self.writer.error is not None:
            raise self.writer.error


def console_for(json_on_stdout: bool, writer: Background | None = None) -> Console:
    return Console(sys.stderr if json_on_stdout else sys.stdout, writer)


def state_fields(status: "Status", flight_time_s: float, link: str = "") -> Sequence[tuple[str, str]]:
    """What is worth knowing at a glance. The position is the vehicle's local NED."""
    fields = [("time", f"{flight_time_s:.1f} s"), ("state", status.state)]
    if not status.vehicle_mode:
        return [*fields, ("vehicle", "none heard yet")]
    position, speed_m_s = status.position_ned_m, status.speed_m_s
    where = "unknown" if position is None else "{:+.2f} {:+.2f} {:+.2f} m".format(*position)
    if speed_m_s is not None:
        where += f", {speed_m_s:.2f} m/s"
    fields += [
        ("mode", status.vehicle_mode if status.armed else f"{status.vehicle_mode} (disarmed)"),
        ("position", where),
        ("detector", status.detector),
    ]
    if status.round_trip_us is not None:
        fields.append(("round trip", f"{status.round_trip_us / 1e3:.0f} ms"))
    return [*fields, ("link", link)] if link else fields
