"""The companion's process: no time, signals, faults inside it."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bench.fly.air import COMPLETED, FAILED, HANDED_OVER, KILLED, Air, Expected, Fault, Injector, When

_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)
_HANDED = Expected((HANDED_OVER,), finds=False)
_FAILS = Expected((FAILED,), finds=False)
# The landing that follows may drift: the goal that `bench kills` measures in full is 1 % above 0.3 m/s.
_DEAD = Expected((KILLED,), finds=False)


@dataclass
class Once(Injector):
    """Something done once, when it is time."""

    when: When
    do: Callable[[Air], None]
    is_done: bool = False

    def each(self, air: Air) -> None:
        if not self.is_done and self.when.is_on(air):
            self.is_done = True
            self.do(air)


class _BrokenError(Exception):
    """A mistake in the program."""


def _stalled(
    seconds: float, when: Callable[[random.Random], When] = When.flying
) -> Callable[[random.Random], Injector]:
    def stall(air: Air) -> None:
        air.stall_s = seconds

    return lambda chance: Once(when(chance), stall)


def _once(do: Callable[[Air], None]) -> Callable[[random.Random], Injector]:
    return lambda chance: Once(When.flying(chance), do)


def _signalled(reason: str) -> Callable[[Air], None]:
    def signal(air: Air) -> None:
        air.interrupts.reason = reason

    return signal


class _Broken:
    """A part of the companion of which one method raises once."""

    def __init__(self, part: Any, method: str, error: Exception) -> None:
        self._part, self._method, self._error = part, method, error

    def __getattr__(self, name: str) -> Any:
        if name == self._method:
            self._method = ""
            raise self._error
        return getattr(self._part, name)


def _step_breaks(error: Exception) -> Callable[[Air], None]:
    """What the flight does next raises."""

    def put(air: Air) -> None:
        core = air.companion.core
        assert core is not None, "it flies"
        core.machine = _Broken(core.machine, "step", error)  # type: ignore[assignment]

    return put


def _encoder_breaks(air: Air) -> None:
    """The next message cannot be packed."""
    encoder = air.companion._encoder
    whole = encoder.packets

    def packets(outgoing: Any) -> list[bytes]:
        encoder.packets = whole  # type: ignore[method-assign]
        raise _BrokenError("not to be packed")

    encoder.packets = packets  # type: ignore[method-assign]


FAULTS = (
    Fault("stall 0.1 s", "the process gets no time for 0.1 s", _stalled(0.1)),
    Fault("stall 0.5 s", "the same for 0.5 s, in the cruise or the hit", _stalled(0.5), _MAY_END),
    Fault("stall 1.2 s", "the same for 1.2 s: PX4 leaves OFFBOARD meanwhile", _stalled(1.2), _MAY_END),
    Fault("stall 3 s", "the same for 3 s: PX4 lands by itself", _stalled(3.0), _MAY_END),
    Fault("stall 1.2 s in a recovery", "the same, up to 0.6 s after the hit", _stalled(1.2, When.recovering), _MAY_END),
    Fault(
        "SIGTERM", "the signal, in the cruise or the hit", _once(_signalled("stopped by a terminate signal")), _HANDED
    ),
    Fault(
        "SIGHUP",
        "the terminal goes, up to 0.6 s after the hit",
        lambda c: Once(When.recovering(c), _signalled("stopped because its terminal is gone")),
        _HANDED,
    ),
    Fault("SIGKILL in the cruise", "nothing of the program goes on", _once(Air.kill), _DEAD),
    Fault(
        "SIGKILL in a recovery",
        "the same, up to 0.6 s after the hit",
        lambda c: Once(When.recovering(c), Air.kill),
        _DEAD,
    ),
    Fault(
        "exception in the step",
        "what the flight does next raises",
        _once(_step_breaks(_BrokenError("nobody thought of this"))),
        _FAILS,
    ),
    Fault("exception in the encoder", "a message cannot be packed", _once(_encoder_breaks), _FAILS),
    Fault("no memory", "MemoryError in the step", _once(_step_breaks(MemoryError())), _FAILS),
)
