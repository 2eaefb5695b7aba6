"""`CollisionGuard`: the guard attached to a program's own MAVSDK, with a thread and a clock."""

import asyncio
import gc
import logging
import sys
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from itertools import product
from typing import Any, Self

from companion.companion import StepResult
from companion.guard.config import GuardConfig
from companion.guard.guard import AttachedGuard
from companion.guard.states import State
from companion.mavlink.moves import REQUESTS, SETPOINTS
from companion.mavlink.named import packet_from
from companion.reflex.recovery.collision import CollisionReport
from companion.report import Event
from companion.shell.clock import Clock
from companion.shell.mavsdk_link import GuardError, MavsdkLink

_LOG = logging.getLogger(__name__)
# Heartbeat within ten seconds, ten streams asked for, two seconds of measuring.
START_TIMEOUT_S = 20.0
# How long a thread of the program's that computes may keep Python from MAVSDK's: between the datagram that shows a hit
# and the setpoint it is waited for up to three times. Python's own 5 ms would be 15; this costs such a thread some 1 %.
SWITCH_INTERVAL_S = 0.0001
# Giving back takes 10 ms. At most three modes are asked for, each given up after 2.5 s (link.commands), after a
# wait for a report of the present one.
GIVING_BACK_US = 10_000_000
# A setpoint's interval.
TRIED_AGAIN_S = 0.02
# Events kept for a program that asks later.
EVENTS_KEPT = 1000


class CollisionGuard:
    """Guards the program's vehicle over the program's own connection, and takes it over at a hit.

    `mavsdk` and `system` are MAVSDK 4's objects. `on_event` is called on the guard's own thread. A `with` block, or an
    `async with` block, starts and stops it. While it is attached, threads take turns every SWITCH_INTERVAL_S
    (sys.setswitchinterval), and older objects are not collected as garbage (gc.freeze).
    Raises GuardError without MAVSDK 4.
    """

    def __init__(
        self,
        mavsdk: Any,
        system: Any,
        config: GuardConfig | None = None,
        on_event: Callable[[Event], None] | None = None,
    ) -> None:
        self._link = MavsdkLink(mavsdk, system)
        self._clock = Clock()
        self._guard = AttachedGuard(config or GuardConfig(), self._link.system_id)
        # Guards all below. MAVSDK's I/O thread and the guard's own meet here, each for less than a millisecond, but for
        # the sample that shows a hit: its setpoint is made in 3 ms, and nothing is more urgent.
        self._changed = threading.Condition()
        self._untold: list[Event] = []
        self._listeners = [] if on_event is None else [on_event]
        self._is_over = False
        self._faulty_until_us: int | None = None  # after a fault around the guard: when giving back must have ended
        self.events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self._switch_interval_s = sys.getswitchinterval()
        self._thread = threading.Thread(target=self._run, name="rebound-guard", daemon=True)

    def start(self) -> None:
        """Attach, once; return when the streams are fast enough, some 3 s later. Raises GuardError if they are not."""
        if self._is_over or self._thread.ident is not None:
            raise GuardError("This guard was started before: make a new CollisionGuard.")
        self._guard.rehearse()
        self._link.intercept(self._incoming, self._outgoing)
        self._switch_interval_s = sys.getswitchinterval()
        sys.setswitchinterval(min(SWITCH_INTERVAL_S, self._switch_interval_s))
        # Looking for garbage among all that a program has loaded takes 0.1 s, on whichever thread it falls.
        gc.freeze()
        self._thread.start()
        with self._changed:
            self._changed.wait_for(lambda: self.state is not State.CONNECTING, START_TIMEOUT_S)
            state, reason = self.state, self._guard.core.flight.reason
        if state in (State.CONNECTING, State.ENDED):
            self.stop()
            raise GuardError(f"No guard: {reason or 'the vehicle does not answer'}.")

    def stop(self) -> None:
        """Give the vehicle back if the guard holds it, and release MAVSDK. Takes 10 s at most."""
        with self._changed:
            core = self._guard.core
            core.stop_reason = "stopped by the program"
            if self._thread.is_alive():
                self._changed.wait_for(lambda: core.handler.finished or self._is_over, GIVING_BACK_US * 1e-6)
            self._is_over = True
            self._changed.notify_all()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()
        self._link.release()
        gc.unfreeze()
        sys.setswitchinterval(self._switch_interval_s)

    def enable(self) -> None:
        """Watch again after the guard has stood down for a pilot."""
        with self._changed:
            self._guard.core.is_enabled = True

    @property
    def state(self) -> State:
        """What the guard is doing now."""
        return self._guard.core.state

    @property
    def holds(self) -> bool:
        """Whether the vehicle flies by the guard's setpoints. The program's setpoints are dropped meanwhile."""
        return self._guard.core.holds

    @property
    def kept_out(self) -> int:
        """How many of the program's setpoints were dropped so far."""
        return self._guard.kept_out

    @property
    def collisions(self) -> tuple[CollisionReport, ...]:
        """Every hit so far, local NED, SI."""
        with self._changed:
            return self._guard.core.collisions()

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Block until the condition holds, and return True; False after `timeout_s`. It is tested after each event."""
        with self._changed:
            return self._changed.wait_for(condition, timeout_s)

    async def watch_events(self) -> AsyncIterator[Event]:
        """Every event from now on, for a program on asyncio."""
        loop = asyncio.get_running_loop()
        queue: asyncio.Queue[Event] = asyncio.Queue()

        def put(event: Event) -> None:
            loop.call_soon_threadsafe(queue.put_nowait, event)

        with self._changed:
            self._listeners.append(put)
        try:
            while True:
                yield await queue.get()
        finally:
            with self._changed:
                self._listeners.remove(put)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    async def __aenter__(self) -> Self:
        await asyncio.to_thread(self.start)
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.to_thread(self.stop)

    def _incoming(self, name: str, source: tuple[int, int], fields_json: bytes) -> bool:
        """On MAVSDK's thread: the sample, and at once what follows from it."""
        if packet := packet_from(name, source, fields_json):
            with self._changed, self._guarded():
                if not self._is_over:
                    self._send(self._guard.step(packet, self._clock.now_us()))
        return True

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Whatever is raised has the vehicle given back, for as long as the link and the steps still do it."""
        try:
            yield
        except Exception as error:
            _LOG.exception("a fault around the guard")
            if self._faulty_until_us is None:
                self._faulty_until_us = self._clock.now_us() + GIVING_BACK_US
                self._guard.core.stop_reason = f"fault around the guard, please report it: {error!r}"
            self._changed.notify_all()

    def _outgoing(self, name: str, source: tuple[int, int], fields_json: bytes) -> bool:
        """On MAVSDK's thread, the last before the socket."""
        if name not in SETPOINTS and name not in REQUESTS:
            return True
        with self._changed:
            # Also of one that cannot be read
            passes = self._is_over or not self.holds or name in REQUESTS
            if not self._is_over and (packet := packet_from(name, source, fields_json)):
                with self._guarded():
                    passes = self._guard.lets_pass(packet)
        return passes

    def _send(self, step: StepResult) -> None:
        try:
            for packet in step.sent_frames:
                self._link.send(packet)
        except RuntimeError as error:
            # The program has destroyed its MAVSDK: there is no connection left to guard on.
            _LOG.warning("the guard ends: %s", error)
            self._is_over = True
        if step.events:
            self._untold += step.events
            self._changed.notify_all()

    def _run(self) -> None:
        while self._turn():
            pass

    def _turn(self) -> bool:
        """What is due when nothing arrives, and telling; user code never runs on MAVSDK's thread.

        Whether there is to be another.
        """
        with self._changed:
            wait_s = (self._guard.next_deadline_us() - self._clock.now_us()) * 1e-6
            if self._faulty_until_us is not None:
                # A step that fails again leaves its deadline where it was.
                wait_s = max(wait_s, TRIED_AGAIN_S)
            if wait_s > 0.0 and not self._untold:
                self._changed.wait(wait_s)
            if not self._is_over and self._clock.now_us() >= self._guard.next_deadline_us():
                with self._guarded():
                    self._send(self._guard.step(b"", self._clock.now_us()))
            until_us = self._faulty_until_us
            if until_us is not None and (self._guard.core.handler.finished or self._clock.now_us() >= until_us):
                # From here on the program's own setpoints pass.
                self._is_over = True
                self._changed.notify_all()
            goes_on = not self._is_over
            told, self._untold = self._untold, []
            self.events.extend(told)
            listeners = list(self._listeners)
        for event, listener in product(told, listeners):
            try:
                listener(event)
            except Exception:
                _LOG.exception("a listener of the guard's events failed")
        return goes_on
