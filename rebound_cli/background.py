"""Writing to disks and terminals on a thread of its own: a flight waits for neither, and survives the end of both."""

import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

# Half a minute of steps at PX4's fastest stream, 250 to 500 a second: longer than a card that tidies up stops, and with
# some 500 bytes a step a few megabytes.
MOST_WAITING = 10_000
# To wake a thread for each of 250 steps a second takes a tenth of a guard's time, and a thread between steps delays the
# next one.
REST_S = 0.05


def at_once(call: Callable[..., object], *arguments: Any) -> None:
    """Where nobody flies in real time, whoever asks for a write waits for it."""
    call(*arguments)


class Background:
    """Makes calls in order on its own thread. What fails, or finds too many waiting, is dropped, counted and told.

    The first is made at once. Whenever all are made it rests: what comes meanwhile is made together.
    """

    def __init__(self, what: str) -> None:
        """`what` is lost when a call is: the subject of the sentence that says so."""
        self._what = what
        self._waiting: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._is_closing = threading.Event()
        self._is_told = False
        # Counted by the giver and by the thread, each its own.
        self._dropped, self._failed = 0, 0
        self.error: Exception | None = None
        # A daemon: the end of the program waits for a disk or a terminal only where `close` does.
        self._thread = threading.Thread(target=self._run, name=f"rebound {what}", daemon=True)
        self._thread.start()

    def give(self, call: Callable[..., object], *arguments: Any) -> None:
        """Have it called soon. Returns at once and raises nothing."""
        if self._waiting.qsize() < MOST_WAITING:
            self._waiting.put(lambda: call(*arguments))
        else:
            self._dropped += 1
            self.error = self.error or TimeoutError("writing takes too long")

    def news(self) -> str | None:
        """What was lost and why, once."""
        if self.error is None or self._is_told:
            return None
        self._is_told = True
        return self.loss

    @property
    def loss(self) -> str | None:
        """What was lost and why, if anything was."""
        error = self.error
        if error is None:
            return None
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error) or type(error).__name__
        return f"{self._what} has gaps: {why}"

    def close(self, timeout_s: float | None = None) -> None:
        """Return when all that was given has been tried, or after `timeout_s`."""
        self._waiting.put(None)
        self._is_closing.set()
        self._thread.join(timeout_s)

    @property
    def lost(self) -> int:
        """How many calls came to nothing."""
        return self._dropped + self._failed

    def _run(self) -> None:
        while (call := self._waiting.get()) is not None:
            try:
                call()
            except Exception as error:
                self._failed += 1
                self.error = self.error or error
            if self._waiting.empty():
                self._is_closing.wait(REST_S)
