"""Ctrl-C, SIGTERM and SIGHUP: the first hands the vehicle over in good order, the second ends the program at once."""

import signal
from types import FrameType
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

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        if self.reason is not None:
            raise KeyboardInterrupt
        self.reason = _REASONS[signal.Signals(number)]
