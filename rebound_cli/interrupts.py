"""Ctrl-C, SIGTERM and SIGHUP: the first hands the vehicle over in good order, the second ends the program at once."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import FrameType, TracebackType
from typing import Self

_REASONS = {
    signal.SIGINT: "stopped with Ctrl-C",
    signal.SIGTERM: "stopped by a terminate signal",
    signal.SIGHUP: "stopped because its terminal is gone",
}


class Interrupts:
    """Keeps the reason of the first signal for a loop to see; a second one raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.reason: str | None = None
        self._previous: dict[signal.Signals, object] = {}

    def __enter__(self) -> Self:
        for number in _REASONS:
            self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        if self.reason is not None:
            raise KeyboardInterrupt
        self.reason = _REASONS[signal.Signals(number)]


@contextmanager
def ctrl_c_waiting() -> Iterator[list[int]]:
    """Meanwhile Ctrl-C is only noted, and the processes that are started never hear of it.

    It reaches every process of the terminal; workers that hear it each print a traceback. They inherit what is blocked.
    """
    pressed: list[int] = []
    # It unblocks the signal when it starts, which is with the first worker otherwise.
    resource_tracker.ensure_running()
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield pressed
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
