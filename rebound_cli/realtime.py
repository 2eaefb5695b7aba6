"""The companion or the guard on a real connection and the real clock."""

import os
import select
from pathlib import Path
from typing import Protocol

from companion.companion import Companion, StepResult
from companion.shell.clock import Clock
from companion.shell.connection import Connection
from rebound_cli.console import Console
from rebound_cli.interrupts import Interrupts
from rebound_cli.run_folder import FlightRecorder

# The loop looks at Ctrl-C, the person's answer and the live line at least this often.
LONGEST_WAIT_S = 0.05


class Confirmation(Protocol):
    """Decides when the plan that the companion has ready may be flown."""

    def poll(self, companion: Companion) -> None: ...


class ConfirmAtOnce:
    """For simulated vehicles, and for --yes; prints the plan first where there is someone to read it."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console
        self._is_done = False

    def poll(self, companion: Companion) -> None:
        if self._is_done or not companion.plan_is_ready():
            return
        self._is_done = True
        if self._console is not None:
            self._console.print(companion.plan_text())
        companion.confirm_plan()


class AskPerson:
    """Prints the plan and waits for a line on stdin that says yes, without stopping the loop."""

    def __init__(self, console: Console, stdin_descriptor: int = 0) -> None:
        self._console = console
        self._stdin = stdin_descriptor
        self._is_asked = False
        self._is_answered = False
        self._typed = b""

    def poll(self, companion: Companion) -> None:
        if self._is_answered:
            return
        if not self._is_asked:
            if companion.plan_is_ready():
                self._is_asked = True
                self._console.print(companion.plan_text())
                self._console.ask("Fly this plan? [y/N] ")
            return
        answer = self._read_answer()
        if answer is None and not companion.finished:
            return
        self._is_answered = True
        self._console.live_is_held = False
        if answer in ("y", "yes"):
            companion.confirm_plan()
        elif answer is not None:
            companion.stop("the plan was not confirmed")

    def _read_answer(self) -> str | None:
        """The line, None while there is none; the end of input is an empty answer, which means no."""
        if not select.select([self._stdin], [], [], 0)[0]:
            return None
        piece = os.read(self._stdin, 1024)
        self._typed += piece
        if piece and b"\n" not in self._typed:
            return None
        return self._typed.split(b"\n")[0].decode(errors="replace").strip().lower()


class Stepped(Protocol):
    """The companion or the guard: bytes and time in, frames and events out."""

    def next_deadline_us(self) -> int: ...

    def step(self, received: bytes, now_us: int) -> StepResult: ...


def exchange(
    stepped: Stepped, connection: Connection, clock: Clock, recorder: FlightRecorder
) -> tuple[int, StepResult]:
    """Wait for bytes or the next deadline, take one step, send and record; the time of the step and what came of it."""
    received = connection.receive(min((stepped.next_deadline_us() - clock.now_us()) / 1e6, LONGEST_WAIT_S))
    now_us = clock.now_us()
    result = stepped.step(received, now_us)
    for frame in result.sent_frames:
        connection.send(frame)
    recorder.record(now_us, result)
    return now_us, result


def look_for_file(companion: Companion, recorder: FlightRecorder, now_us: int) -> None:
    """For a mission that waits for a file."""
    if companion.file_awaited is not None and Path(companion.file_awaited).exists():
        companion.file_is_there()
        recorder.record_file(now_us)


def fly_realtime(
    companion: Companion,
    connection: Connection,
    clock: Clock,
    recorder: FlightRecorder,
    console: Console,
    confirmation: Confirmation,
    interrupts: Interrupts,
) -> None:
    """Run until the companion has finished; after the first interrupt it finishes by itself."""
    started_us = clock.now_us()
    is_stopped = False
    while not companion.finished:
        now_us, result = exchange(companion, connection, clock, recorder)
        if result.events:
            recorder.record_obstacles(companion.obstacles())
        confirmation.poll(companion)
        look_for_file(companion, recorder, now_us)
        if interrupts.reason is not None and not is_stopped:
            is_stopped = True
            companion.stop(interrupts.reason)
        recorder.record_person(now_us, companion.plan_is_confirmed, companion.stop_reason)
        console.live(companion.status, (now_us - started_us) / 1e6)
