"""Ctrl-C, SIGTERM and SIGHUP: the first hands the vehicle over in good order, the last ends the program at once."""

import signal
import threading
from types import FrameType
from typing import Self

_REASONS = {
    signal.SIGINT: "stopped with Ctrl-C",
    signal.SIGTERM: "stopped by a terminate signal",
    signal.SIGHUP: "stopped because its terminal is gone",
}


class Interrupts:
    """Keeps the reason of a signal for a loop to see. The second one raises KeyboardInterrupt; where the first was put
    off it is another reason, and the third one raises.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._count = self._told = 0
        self._may_insist = False
        self._previous: dict[signal.Signals, object] = {}

    def news(self, is_put_off: bool) -> str | None:
        """A reason that has come since; `is_put_off`: what the one before asked for still waits."""
        self._may_insist = is_put_off and self._count < 2
        if self._told == self._count:
            return None
        self._told = self._count
        return self.reason

    def __enter__(self) -> Self:
        # Only a program's main thread may hear signals; a flight in another one, as in a worker of Dask, has none.
        is_main = threading.current_thread() is threading.main_thread()
        for number in _REASONS if is_main else ():
            self._previous[number] = signal.signal(number, self.on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def on_signal(self, number: int, _: FrameType | None) -> None:
        if self._count > 0 and number == signal.SIGHUP:
            return  # a shell's, and its kernel's: a terminal goes once
        if self._count > 0 and not self._may_insist:
            raise KeyboardInterrupt
        self._count += 1
        self._may_insist = False
        self.reason = _REASONS[signal.Signals(number)] + (", and once more" if self._count > 1 else "")
