"""The simulated vehicle as a process of its own, which never outlives the flight."""

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn, Self

from companion.errors import ReboundError
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import RESOLVED_NAME, TRUTH_NAME, VEHICLE_LOG_NAME
from rebound_cli.simulation.compiling import COMPILED, COMPILING

# Writing the truth of a long flight takes well under a second; a process that takes longer is stuck.
STOP_TIMEOUT_S = 5.0

# What `rebound sim` prints once it is on the air.
READY_WORDS = "Simulated vehicle"

_READY_POLL_S = 0.02


class VehicleProcess:
    """`rebound sim` with the run's world and options of its own; its stdin is the leash that ends it."""

    def __init__(self, folder: Path, options: Sequence[str], ready_words: str = READY_WORDS) -> None:
        """It is ready when a line of its output begins with ``ready_words``."""
        self._folder = folder
        self._ready_words = ready_words
        command = [sys.executable, "-m", "rebound_cli", "sim", "--mission", str(folder / RESOLVED_NAME)]
        command += [*options, "--truth", str(folder / TRUTH_NAME), "--stop-with-stdin"]
        with (folder / VEHICLE_LOG_NAME).open("wb") as log:
            # Ctrl-C goes to the companion alone: the vehicle has to fly on until it has landed or holds.
            pipe = subprocess.PIPE
            self._process = subprocess.Popen(command, stdin=pipe, stdout=log, stderr=log, start_new_session=True)

    def wait_until_ready(self, interrupts: Interrupts, console: Console) -> None:
        """Return when the vehicle is on the air. Raises ReboundError when the person has had enough.

        The companion waits ten seconds for a vehicle; compiling the physics may take longer.
        """
        told, is_ready = 0, False
        while not is_ready:
            self.check_running()
            if interrupts.reason is not None:
                # It has nothing to hand over, and may be compiling: it is not waited for.
                self._process.kill()
                raise ReboundError(f"The flight was {interrupts.reason} before the vehicle was ready.")
            for line in self._said()[told:]:
                told += 1
                is_ready |= line.startswith(self._ready_words)
                if line.startswith((COMPILING, COMPILED)):
                    console.print(line)
            if not is_ready:
                time.sleep(_READY_POLL_S)

    def check_running(self) -> None:
        """Raise ReboundError if it has ended."""
        if self._process.poll() is not None:
            self._raise_why()

    def check_ended_well(self) -> None:
        """Raise ReboundError if it has ended, but not by its leash alone."""
        if self._process.returncode:
            self._raise_why()

    def _raise_why(self) -> NoReturn:
        """With the process's last words, unless it was killed."""
        code = self._process.returncode
        last = (self._said() or [f"exit code {code}"])[-1] if code >= 0 else f"killed by signal {-code}"
        raise ReboundError(f"The simulated vehicle ended by itself: {last.removeprefix('rebound: ')}")

    def _said(self) -> list[str]:
        return (self._folder / VEHICLE_LOG_NAME).read_text(errors="replace").strip().splitlines()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the process; its truth file is complete when this returns."""
        if kind is KeyboardInterrupt:
            self._process.kill()
        if self._process.stdin is not None:
            self._process.stdin.close()
        for harsher in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(STOP_TIMEOUT_S)
                return
            except subprocess.TimeoutExpired:
                harsher()
        self._process.wait()
