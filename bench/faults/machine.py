"""The computer around the companion: disks that take nothing, and readers that are gone."""

import errno
import io
import os
import random
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from bench.fly.air import Air, Fault, Injector, When
from rebound_cli.background import Background
from rebound_cli.live.console import Console


class _DiskError:
    """A disk that refuses from a moment on."""

    def __init__(self, number: int) -> None:
        self.number, self.refuses = number, False

    def check(self) -> None:
        if self.refuses:
            raise OSError(self.number, os.strerror(self.number))


class _Writer(Background):
    """Writes as the product does, on a thread of its own, to a disk that may refuse or stop."""

    def __init__(self, before: Callable[[], object]) -> None:
        super().__init__("log")
        self._before = before

    def give(self, call: Callable[..., object], *arguments: object) -> None:
        # Closing the files is no fault of theirs.
        if getattr(call, "__name__", "") == "close":
            super().give(call, *arguments)
            return
        super().give(self._call, call, *arguments)

    def _call(self, call: Callable[..., object], *arguments: object) -> None:
        self._before()
        call(*arguments)


@dataclass
class Refusing(Injector):
    """Every write fails from a moment on."""

    when: When
    number: int
    disk: _DiskError = field(init=False)

    def __post_init__(self) -> None:
        self.disk = _DiskError(self.number)

    def each(self, air: Air) -> None:
        self.disk.refuses = self.when.is_on(air)

    def writer(self) -> Background:
        return _Writer(self.disk.check)


@dataclass
class Stopped(Injector):
    """A write does not return before the flight is over."""

    when: When
    going_on: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self.going_on.set()

    def each(self, air: Air) -> None:
        if self.when.is_on(air):
            self.going_on.clear()

    def end(self) -> None:
        self.going_on.set()

    def writer(self) -> Background:
        return _Writer(lambda: self.going_on.wait(60.0))


class _Pipe(io.StringIO):
    """One whose reader is gone."""

    def write(self, text: str) -> int:
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


class Gone(Injector):
    """Nobody reads what is printed."""

    def console(self) -> Console:
        return Console(_Pipe(), Background("console"))


def _refusing(number: int) -> Callable[[random.Random], Injector]:
    return lambda chance: Refusing(When.flying(chance), number)


FAULTS = (
    Fault("disk full", "every write fails from the cruise on: ENOSPC", _refusing(errno.ENOSPC)),
    Fault("size limit", "the same: EFBIG", _refusing(errno.EFBIG)),
    Fault("disk read-only", "the same: EROFS", _refusing(errno.EROFS)),
    Fault("disk dies", "the same: EIO", _refusing(errno.EIO)),
    Fault("disk stands still", "a write does not return until the flight is over", lambda c: Stopped(When.flying(c))),
    Fault("stdout gone", "nobody reads the console from the start on: EPIPE", lambda c: Gone(), from_the_start=True),
)
