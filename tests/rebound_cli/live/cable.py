"""A serial line without hardware: two pseudo-terminals, a UART's speed between them, and what it loses."""

import contextlib
import os
import pty
import random
import threading
import time
import tty
from pathlib import Path
from typing import Self

# Eight bits, a start and a stop bit.
BITS = 10
TICK_S = 0.002
# A fault swallows so many bytes, which is a third of a common packet.
SWALLOWED = 20
PACKET = 60


class Cable:
    """From a vehicle's UART to a device that has a name as udev's links are: what it leads to is another each time.

    `loss`: of the packets, about; a fault now and then swallows some bytes in a row.
    """

    def __init__(self, name: Path, baud: int, loss: float, seed: int = 1) -> None:
        self.name, self._baud, self._random = name, baud, random.Random(seed)
        self._mean_gap = (PACKET + SWALLOWED) / loss
        self._far = pty.openpty()
        self._near: tuple[int, int] | None = None
        self._next = pty.openpty()
        for port in self._far:
            os.set_blocking(port, False)
        tty.setraw(self._far[1])
        self.vehicle_url = f"serial://{os.ttyname(self._far[1])}:{baud}"
        self.url = f"serial://{name}:{baud}"
        self._until_fault = dict.fromkeys(("in", "out"), self._mean_gap)
        self._lock, self._is_over = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._carry)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        self.unplug()
        for port in (*self._far, *self._next):
            os.close(port)

    def plug(self) -> str:
        """Returns what the name leads to."""
        # The next one is there before this one goes: it gets another name.
        near, self._next = self._next, pty.openpty()
        for port in near:
            os.set_blocking(port, False)
        tty.setraw(near[1])
        with self._lock:
            self._near = near
        self.name.symlink_to(os.ttyname(near[1]))
        return os.ttyname(near[1])

    def unplug(self) -> None:
        with self._lock:
            near, self._near = self._near, None
        if near is not None:
            self.name.unlink()
            for port in near:
                os.close(port)

    def _carry(self) -> None:
        budget = {"in": 0.0, "out": 0.0}
        before_s = time.monotonic()
        while not self._is_over.wait(TICK_S):
            now_s = time.monotonic()
            passing, before_s = (now_s - before_s) * self._baud / BITS, now_s
            with self._lock:
                near = None if self._near is None else self._near[0]
                for way, source, sink in (("in", near, self._far[0]), ("out", self._far[0], near)):
                    # What has waited for longer than a UART's buffer has been overwritten.
                    budget[way] = min(budget[way] + passing, 4096.0)
                    if source is not None and budget[way] >= 1.0:
                        budget[way] -= self._pass(way, source, sink, int(budget[way]))

    def _pass(self, way: str, source: int, sink: int | None, most: int) -> int:
        try:
            content = os.read(source, most)
        except OSError:
            return 0
        with contextlib.suppress(OSError):
            if sink is not None:
                os.write(sink, self._worn(way, content))
        return len(content)

    def _worn(self, way: str, content: bytes) -> bytes:
        left = b""
        while len(content) > self._until_fault[way]:
            place = int(self._until_fault[way])
            left, content = left + content[:place], content[place + SWALLOWED :]
            self._until_fault[way] = self._random.expovariate(1.0 / self._mean_gap)
        self._until_fault[way] -= len(content)
        return left + content
