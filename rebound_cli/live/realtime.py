"""The companion or the guard on a real connection and the real clock."""

import contextlib
import os
import select
import termios
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from companion.companion import Companion, Stepped, StepResult
from companion.errors import ReboundError
from companion.messages import ComputerStatus
from companion.shell.clock import Clock
from companion.shell.computer import computer_status
from companion.shell.connections.connection import Connection
from companion.shell.service_manager import ServiceManager, service_manager
from rebound_cli.background import Background
from rebound_cli.live.console import Console, state_fields
from rebound_cli.live.heir import Heir
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.status import StatusServer
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.timing import LinkRate, Timing, undisturbed

# The loop looks at Ctrl-C, the person's answer and the live line at least this often.
LONGEST_WAIT_S = 0.05
# Handing over is three requests at most, disarm, hold and land, each given up after 2.5 s (link.commands).
HANDING_OVER_US = 10_000_000
# What needs an answer now, by the bytes of its id in a MAVLink 2 header: HIGHRES_IMU shows a hit, TIMESYNC a time. All
# else is decided with the next of these, and waits no longer than an interval of 200 Hz.
URGENT = (b"\x69\x00\x00", b"\x6f\x00\x00")
LONGEST_HELD_US = 5_000
# MAVLink's heartbeat goes as often, and a person watches no faster.
COMPUTER_EVERY_US = 1_000_000


class FlightFaultError(ReboundError):
    """Something around the flight failed; the vehicle has been handed over, as far as it could be reached."""


def confirm_now(companion: Companion, console: Console | None = None) -> None:
    """For simulated vehicles, and for --yes; prints the plan first where there is someone to read it."""
    if companion.plan_is_ready():
        if console is not None:
            console.print(companion.plan_text())
        companion.confirm_plan()


class AskPerson:
    """Prints the plan and waits for a line on stdin that says yes, without stopping the loop.

    A plan that is made anew is asked for anew; what was typed meanwhile says nothing of it.
    """

    def __init__(self, console: Console, stdin_descriptor: int = 0) -> None:
        self._console = console
        self._stdin = stdin_descriptor
        self._is_asked = self._is_asked_again = False
        self._typed = b""

    def poll(self, companion: Companion) -> None:
        if not companion.plan_is_ready():
            self._is_asked = self._console.live_is_held = False
            return
        if not self._is_asked:
            # What was typed before the plan is shown says nothing of it; a pipe's first line is an answer on purpose.
            with contextlib.suppress(termios.error):
                termios.tcflush(self._stdin, termios.TCIFLUSH)
            if self._is_asked_again:
                self._read_answer()
                self._typed = b""
            self._is_asked = self._is_asked_again = True
            self._console.print(companion.plan_text())
            self._console.ask("Fly this plan? [y/N] ")
        elif (answer := self._read_answer()) in ("y", "yes"):
            companion.confirm_plan()
        elif answer is not None:
            remedy = "" if answer or os.isatty(self._stdin) else "; without a terminal --yes does"
            companion.stop(f"the plan was not confirmed{remedy}")

    def _read_answer(self) -> str | None:
        """The line, None while there is none; the end of input is an empty answer, which means no."""
        if not select.select([self._stdin], [], [], 0)[0]:
            return None
        piece = os.read(self._stdin, 1024)
        self._typed += piece
        if piece and b"\n" not in self._typed:
            return None
        return self._typed.split(b"\n")[0].decode(errors="replace").strip().lower()


def look_for_file(companion: Companion, recorder: FlightRecorder, now_us: int) -> None:
    """For a mission that waits for a file. One of an impossible name is not there: `Path.exists` raises."""
    file = companion.core.flight.file_awaited
    if file is not None and os.path.exists(file):
        companion.file_is_there()
        recorder.record_input(now_us, "file")


class Computer:
    """Once a second its status of a second ago, read on a thread of its own: a disk that hangs answers nobody."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._background = Background("the computer's status")
        self._latest: ComputerStatus | None = None
        self._due_us = 0

    def status(self, now_us: int) -> ComputerStatus | None:
        """None as long as none is due, and where none could be read."""
        if now_us < self._due_us:
            return None
        self._due_us = now_us + COMPUTER_EVERY_US
        latest, self._latest = self._latest, None
        self._background.give(self._read, now_us)
        return latest

    def _read(self, now_us: int) -> None:
        self._latest = computer_status(self._folder, now_us)

    def close(self) -> None:
        # A disk that hangs is not waited for.
        self._background.close(0.1)


def watched(folder: Path, is_wanted: bool) -> contextlib.AbstractContextManager[Computer | None]:
    """The computer, and the disk that the folder is on; None where nobody wants to know."""
    return contextlib.closing(Computer(folder)) if is_wanted else contextlib.nullcontext()


@dataclass(slots=True)
class Loop:
    """Exchanges with a vehicle until what is stepped has finished."""

    stepped: Stepped[Any]
    connection: Connection
    clock: Clock
    recorder: FlightRecorder
    console: Console
    interrupts: Interrupts
    server: StatusServer | None = None
    computer: Computer | None = None
    timing: Timing = field(default_factory=Timing)
    heard: LinkRate = field(default_factory=LinkRate)
    manager: ServiceManager | None = field(default_factory=service_manager)
    now_us: int | None = None  # of the last step
    is_interrupted: bool = False
    heir: Heir | None = None  # once there is a vehicle to be told something

    def run(self, beside: Callable[[int, StepResult], None], is_over: Callable[[], bool] = lambda: False) -> None:
        """After the first interrupt it finishes by itself. `beside` is what happens besides with each step.

        The state is shown on the console and told over the status socket. Whatever is raised in all this hands the
        vehicle over first, and then ends in FlightFaultError.
        """
        started_us = self.clock.now_us()
        if self.manager is not None:
            self.manager.go_first()
        self.stepped.rehearse()
        with undisturbed() as allow_collecting:
            try:
                while not (self.stepped.finished or is_over()):
                    now_us, result = self.exchange()
                    allow_collecting(self.stepped.armed is False)
                    beside(now_us, result)
                    self._show(result, (now_us - started_us) / 1e6)
                    self._look_up(now_us)
            except Exception as error:
                place = traceback.extract_tb(error.__traceback__)[-1]
                reason = f"fault around the flight, please report it: {type(error).__name__} in {place.name}: {error}"
                self._hand_over(reason)
                raise FlightFaultError(f"F{reason[1:]}; the vehicle was handed over, as far as it answered.") from error
            except KeyboardInterrupt:
                if self.heir is not None:
                    self.heir.leave()
                raise
            finally:
                if self.heir is not None:
                    self.heir.close()

    def exchange(self) -> tuple[int, StepResult]:
        """Wait for bytes or the next deadline, take one step, send and record; when it was and what came of it."""
        deadline_us = self.stepped.next_deadline_us()
        received = self._received(deadline_us)
        now_us = self.clock.now_us()
        self.heard.take(len(received), now_us)
        result = self._step(received, now_us)
        if (late := self.timing.stepped(deadline_us, now_us, self.clock.now_us())) is not None:
            self._note("late", late, now_us)
        return now_us, result

    def _received(self, deadline_us: int) -> bytes:
        """What has come by a deadline, and what comes after it until nothing of it may wait."""
        left_us = deadline_us - self.clock.now_us()
        received = more = self.connection.receive(min(left_us / 1e6, LONGEST_WAIT_S))
        held_us = min(deadline_us, self.clock.now_us() + LONGEST_HELD_US)
        while received and not any(urgent in more for urgent in URGENT):
            left_us = held_us - self.clock.now_us()
            if left_us <= 0:
                break
            more = self.connection.receive(left_us / 1e6)
            received += more
        return received

    def _step(self, received: bytes, now_us: int) -> StepResult:
        result = self.stepped.step(received, now_us)
        self.now_us = now_us
        try:
            for frame in result.sent_frames:
                self.connection.send(frame)
            self._leave_word()
        finally:
            self.recorder.record(now_us, result)
        if self.manager is not None:
            is_ending = self.is_interrupted or self.stepped.finished
            self.manager.stepped(self.stepped.armed is not None, is_ending, self._status_text, now_us)
        return result

    def _leave_word(self) -> None:
        """After all that this step sends: what has to be said if it is the last one."""
        if self.heir is None and self.stepped.armed is not None:
            self.heir = Heir()
        if self.heir is not None:
            self.heir.hear(self.stepped.last_words(), self.connection)

    def _status_text(self) -> str:
        _, *fields = state_fields(self.stepped.status(), 0.0, self.heard.text(self.now_us or 0))
        return ", ".join(f"{name} {text}" for name, text in fields)

    def _show(self, result: StepResult, running_s: float) -> None:
        link = self.heard.text(self.now_us or 0)
        self.console.live(self.stepped.status, running_s, link)
        if self.server is not None:
            self.server.hand_over(self.stepped.status, result.events, running_s, link)

    def _look_up(self, now_us: int) -> None:
        """Whether somebody wants an end, and whether all that was to be written was."""
        if (reason := self.interrupts.news(self.stepped.stop_is_put_off)) is not None:
            self.is_interrupted = True
            self._stop(reason)
        if (news := self.connection.news()) is not None:
            self._note("link", news, now_us)
        if self.stepped.armed is None:
            # Nobody has been heard yet who could be told.
            return
        if self.computer is not None and (computer := self.computer.status(now_us)) is not None:
            self.stepped.tell_computer(computer)
            self.recorder.record_input(now_us, "computer", status=asdict(computer))
        for writer in (self.recorder.writer, self.console.writer, self.manager):
            if writer is not None and (loss := writer.news()) is not None:
                self._note("lost", loss, now_us)

    def _note(self, kind: str, text: str, now_us: int) -> None:
        self.stepped.note(kind, text)
        self.recorder.record_input(now_us, "note", event=kind, text=text)

    def _stop(self, reason: str) -> None:
        self.stepped.stop(reason)
        if self.now_us is not None:
            self.recorder.record_input(self.now_us, "stop", reason=reason)

    def _hand_over(self, reason: str) -> None:
        """With the steps and the link alone. Where these fail again the next one is tried, for as long as it takes."""
        self._stop(reason)
        until_us = self.clock.now_us() + HANDING_OVER_US
        while not self.stepped.finished and self.clock.now_us() < until_us:
            wait_s = min((self.stepped.next_deadline_us() - self.clock.now_us()) / 1e6, LONGEST_WAIT_S)
            received = b""
            try:
                received = self.connection.receive(wait_s)
            except Exception:
                # A link that cannot be read may still be written to.
                self.clock.sleep(wait_s)
            # Where a step fails again, the next one goes on by time alone.
            with contextlib.suppress(Exception):
                self._step(received, self.clock.now_us())


def fly_realtime(companion: Companion, loop: Loop, confirm: Callable[[Companion], None]) -> None:
    """Run the companion's loop until it has finished; after the first interrupt it finishes by itself."""
    recorder = loop.recorder

    def beside(now_us: int, result: StepResult) -> None:
        if result.events:
            recorder.record_obstacles(companion.obstacles())
            loop.console.events(result.events, companion.core.started_at_us)
        was_ready, stop_reason = companion.plan_is_ready(), companion.core.stop_reason
        confirm(companion)
        look_for_file(companion, recorder, now_us)
        if was_ready and not companion.plan_is_ready():
            recorder.record_input(now_us, "confirm")
        if companion.core.stop_reason != stop_reason:
            recorder.record_input(now_us, "stop", reason=companion.core.stop_reason)

    loop.run(beside)
