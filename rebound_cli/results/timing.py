"""How steadily a flight's loop runs, and what keeps Python itself from disturbing it."""

import ctypes
import gc
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress

# PX4 leaves offboard control where fewer than two setpoints come in a second (its guide to offboard mode).
TOO_LATE_US = 500_000
# Fine enough to see a millisecond, and few enough different numbers for a flight of hours.
_BIN_US = 100
# How long another thread of ours may keep the loop's from running: Python's own 5 ms is more than a sample's interval.
_SWITCH_INTERVAL_S = 0.0001
# A figure that a person can read; PX4's slowest stream, the heartbeat, comes once a second.
_SECOND_US = 1_000_000


class Timing:
    """Of every step that was due: how late it began. Of every step: how long it took."""

    def __init__(self) -> None:
        self._late: Counter[int] = Counter()
        self._took: Counter[int] = Counter()
        self._told_us = TOO_LATE_US // 2

    def stepped(self, deadline_us: int, began_us: int, ended_us: int) -> str | None:
        """Count a step; an alarm where one was too late, and twice as late as any that was told of. 0: no deadline."""
        self._took[(ended_us - began_us) // _BIN_US] += 1
        late_us = began_us - deadline_us
        if late_us < 0 or deadline_us == 0:
            return None
        self._late[late_us // _BIN_US] += 1
        if late_us < 2 * self._told_us:
            return None
        self._told_us = late_us
        return f"setpoints {late_us / 1e3:.0f} ms late, PX4 needs two a second"

    def summary(self) -> Mapping[str, Mapping[str, float]]:
        """In milliseconds, for summary.json."""
        return {"tick_lateness_ms": _quantiles_ms(self._late), "step_ms": _quantiles_ms(self._took)}


class LinkRate:
    """What of the link is worth a glance: how much comes in, or for how long nothing has."""

    def __init__(self) -> None:
        self._bytes = 0
        self._since_us = self._last_us = 0
        self._text = ""

    def take(self, count: int, now_us: int) -> None:
        if count:
            self._since_us = self._since_us or now_us
            self._bytes, self._last_us = self._bytes + count, now_us

    def text(self, now_us: int) -> str:
        """The rate of about the last second; empty before anything has been heard."""
        if self._last_us == 0:
            return ""
        if now_us - self._last_us >= _SECOND_US:
            return f"silent for {(now_us - self._last_us) / 1e6:.1f} s"
        if now_us - self._since_us >= _SECOND_US:
            self._text = f"{self._bytes / 1e3 / ((now_us - self._since_us) / 1e6):.1f} kB/s"
            self._bytes, self._since_us = 0, now_us
        return self._text


def _quantiles_ms(counts: Counter[int]) -> Mapping[str, float]:
    values = sorted(counts.elements())
    most = len(values) - 1
    places = {"p50": most // 2, "p99": 99 * most // 100, "max": most}
    return {name: values[place] * _BIN_US / 1e3 if values else 0.0 for name, place in places.items()}


@contextmanager
def undisturbed() -> Iterator[Callable[[bool], None]]:
    """No garbage is collected until what this gives is told that it may be; the switch between threads is quick.

    What exists now is never looked at again: a collection while the vehicle is disarmed finds little to look at.
    """
    was_enabled, switch_interval_s = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    # Compiling leaves free pages: 55 MB where no bytecode was kept. The C library may lack the call.
    with suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(min(_SWITCH_INTERVAL_S, switch_interval_s))

    def allow(may_collect: bool) -> None:
        if may_collect != gc.isenabled():
            (gc.enable if may_collect else gc.disable)()

    try:
        yield allow
    finally:
        sys.setswitchinterval(switch_interval_s)
        gc.unfreeze()
        allow(was_enabled)
