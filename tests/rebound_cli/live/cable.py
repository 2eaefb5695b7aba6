"""A serial cable without hardware: what goes into one of two pseudo-terminals comes out of the other."""

import contextlib
import os
import pty
import threading
import tty
from pathlib import Path
from typing import Self

BAUD = 921_600
TICK_S = 0.002


class Cable:
    """From a vehicle's port to a device that has a name as udev's links are: what it leads to is another each time."""

    def __init__(self, name: Path) -> None:
        self.name, self.url = name, f"serial://{name}:{BAUD}"
        self._far, self._next = _terminal(), _terminal()
        self._near: tuple[int, int] | None = None
        self.vehicle_url = f"serial://{os.ttyname(self._far[1])}:{BAUD}"
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
        # The next one is there before this one goes: it gets another name.
        near, self._next = self._next, _terminal()
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
        while not self._is_over.wait(TICK_S):
            with self._lock:
                near = self._far[0] if self._near is None else self._near[0]
                for source, sink in ((near, self._far[0]), (self._far[0], near)):
                    # Nothing waits, or whoever should take it does not: a line without flow control loses it then.
                    with contextlib.suppress(OSError):
                        content = os.read(source, 4096)
                        if self._near is not None:
                            os.write(sink, content)


def _terminal() -> tuple[int, int]:
    ports = pty.openpty()
    tty.setraw(ports[1])
    for port in ports:
        os.set_blocking(port, False)
    return ports
