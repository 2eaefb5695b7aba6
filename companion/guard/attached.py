"""The guard on a program's own connection: messages as names and fields in and out, and a gate for what passes."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from companion.autopilot.known import ASSUMED
from companion.core import POLL_INTERVAL_US
from companion.guard.config import GuardConfig
from companion.guard.core import GuardCore
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID
from companion.mavlink.encode import Encoder
from companion.mavlink.moves import SETPOINTS, asked_of
from companion.mavlink.readers import sample_from
from companion.messages import OnboardHeartbeat, Sample, TimeSync
from companion.report import Event

# Own setpoints that are remembered until they pass the gate: one for each IMU sample of a second, in which PX4 holds
# the last.
_MOST_ON_THE_WAY = 250

Mark: TypeAlias = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class AttachedStep:
    """Messages to send, in order, and events of one step."""

    sent: Sequence[tuple[str, Mapping[str, Any]]]
    events: Sequence[Event]


class _OfPx4(GuardCore):
    """Fields are read and sent as PX4 has them."""

    def _hear(self, samples: Sequence[Sample], now_us: int) -> tuple[Sequence[Sample], str | None]:
        heard, refusal = super()._hear(samples, now_us)
        if refusal is None and self.flight.vehicle.autopilot is not ASSUMED:
            refusal = "a guard inside a program guards PX4 alone: use `rebound guard --between`"
        return heard, refusal


class AttachedGuard:
    """Joins fields with the pure core; holds no clock and no thread. Times are microseconds, any epoch.

    A step that is late by a whole poll shows a stall. The messages that waited then arrive one after the other: all
    that is heard within POLL_INTERVAL_US becomes one step, and no silence is judged before it.

    The program's own heartbeats and its share of TIMESYNC are already there; none are added. A program would take an
    answer to a question of the guard's for one to its own, so the round trip is not measured here.
    """

    def __init__(self, config: GuardConfig, system_id: int, now_us: int) -> None:
        self.core = _OfPx4(config, True)
        self.core.begin(now_us)
        self._source = (system_id, AUTOPILOT_COMPONENT_ID)
        self._encoder = Encoder()
        self._encoder.speak_to(*self._source)
        self._gate = Gate()
        self.kept_out = 0  # setpoints that did not go on
        self._arrived: list[Sample] = []
        self._drained_us: int | None = None  # after a stall: when what arrived in it has been heard

    def hear(self, name: str, source: tuple[int, int], fields: Mapping[str, Any], now_us: int) -> AttachedStep:
        """A message that has arrived."""
        sample = sample_from(name, source, fields) if source == self._source else None
        return self.step(() if sample is None else (sample,), now_us)

    def step(self, samples: Sequence[Sample], now_us: int) -> AttachedStep:
        """Take received samples, or none when only time has passed."""
        if self._is_draining(now_us):
            self._arrived += samples
            return AttachedStep((), ())
        outputs = self.core.advance([*self._arrived, *samples], now_us)
        self._arrived.clear()
        sent: list[tuple[str, Mapping[str, Any]]] = []
        for message in outputs.messages:
            if not isinstance(message, OnboardHeartbeat | TimeSync):
                sent += self._encoder.fields(message)
        for name, fields in sent:
            if name in SETPOINTS:
                self._gate.sends(fields)
        return AttachedStep(sent, outputs.events)

    def _is_draining(self, now_us: int) -> bool:
        if self._drained_us is None:
            if now_us - self.core.next_deadline_us() >= POLL_INTERVAL_US:
                self._drained_us = now_us + POLL_INTERVAL_US
        elif now_us >= self._drained_us:
            self._drained_us = None
        return self._drained_us is not None

    def lets_pass(self, name: str, fields: Mapping[str, Any], now_us: int) -> bool:
        """Whether a message on its way may go on: all but others' setpoints for this vehicle while the guard holds."""
        is_for_it = fields.get("target_system", 0) in (0, self._source[0])
        if name not in SETPOINTS or not is_for_it or self._gate.is_own(fields):
            return True
        self.core.flight.hear_setpoint(asked_of(name, fields), now_us)
        if not self.core.machine.holds:
            return True
        self.kept_out += 1
        return False

    def next_deadline_us(self) -> int:
        return self.core.next_deadline_us() if self._drained_us is None else self._drained_us


class Gate:
    """Recognises the guard's own setpoints by their content, in the order in which they were sent."""

    def __init__(self) -> None:
        self._own: deque[Mark] = deque(maxlen=_MOST_ON_THE_WAY)

    def sends(self, fields: Mapping[str, object]) -> None:
        """The guard is about to send this one."""
        self._own.append(_mark(fields))

    def is_own(self, fields: Mapping[str, object]) -> bool:
        """Whether a setpoint on its way is the guard's; asked once for each."""
        mark = _mark(fields)
        if mark not in self._own:
            return False
        while self._own.popleft() != mark:
            pass
        return True


def _mark(fields: Mapping[str, object]) -> Mark:
    """Time, mask, and place or attitude, which may be NaN; two setpoints with the same of these are the same."""
    attitude = fields.get("q")
    numbers = attitude if isinstance(attitude, Sequence) else [fields.get(name) for name in "xyz"]
    rounded = (round(n, 3) if isinstance(n, float | int) and math.isfinite(n) else None for n in numbers)
    return (fields.get("time_boot_ms"), fields.get("type_mask"), *rounded)
