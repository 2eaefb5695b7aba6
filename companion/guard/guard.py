"""The guard as a step function: bytes and the time in, bytes and events out."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

from companion.autopilot.known import ASSUMED
from companion.companion import Stepped, StepResult
from companion.flight.core import POLL_INTERVAL_US
from companion.flight.rehearsal import rehearsed
from companion.guard.between import Between
from companion.guard.config import GuardConfig
from companion.guard.machine import GuardCore
from companion.guard.states import State
from companion.guard.watching import OTHERS_STOPPED_US
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID
from companion.mavlink.moves import SETPOINT_IDS, asked_by, is_for, would_move
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.mavlink.readers import GUARD_READERS
from companion.messages import Asked, Outgoing, SendCommand
from companion.motion.vector import ZERO, minus, plus


class Guard(Stepped[GuardCore]):
    """On a link of its own, or between the vehicle and its clients, whose packets pass it (see guard.between)."""

    def __init__(self, config: GuardConfig) -> None:
        super().__init__(GuardCore(config), GUARD_READERS)
        self._shift_ned_m = ZERO  # of the local frame, when the last setpoint came

    def _rehearsed(self) -> Iterable[Outgoing]:
        return rehearsed(GuardCore(GuardConfig()), State.WATCHING, ASSUMED.sticks)

    def look_at(self, between: Between, now_us: int) -> Iterator[tuple[str, dict[str, Any]]]:
        """After a step: close or open it; what its clients have sent since the last one, kind and numbers."""
        vehicle = self.core.flight.vehicle
        between.is_closed = self.core.holds or self.core.begins_in_flight
        between.autopilot = vehicle.autopilot
        between.system_id = None if vehicle.identity is None else vehicle.identity.system_id
        if between.has_chosen:
            between.has_chosen = False
            self.hear_choice()
            yield "choice", {}
        between.awaits_choice = self.core.flight.awaits_choice
        if (setpoint := between.new_setpoint(now_us)) is not None:
            self.hear_setpoint(setpoint)
            yield "setpoint", asdict(setpoint)
        for message_id, interval_us in between.intervals:
            self.hear_interval(message_id, interval_us)
            yield "interval", {"message_id": message_id, "interval_us": interval_us}
        between.intervals.clear()

    def hear_setpoint(self, asked: Asked) -> None:
        """A client's, in the vehicle's own frame, has been on its way since the last step.

        A place without a velocity moves as it has moved since the one before.
        """
        guard, shift, now_us = self.core.flight, self.core.resets.shift_ned_m, self.core.now_us
        before, since_s = guard.asked.place_ned_m, (now_us - guard.others_setpoint_us) * 1e-6
        if shift != self._shift_ned_m:
            # The frame has moved since the one before, and not the place.
            self._shift_ned_m, before = shift, None
        place, velocity = asked.place_ned_m, asked.velocity_ned_m_s
        if place is not None:
            place = minus(place, shift)
            if velocity is None and before is not None and 0.0 < since_s < OTHERS_STOPPED_US * 1e-6:
                moves = plus(ZERO, 1.0 / since_s, minus(place, before))
                # What goes faster than a vehicle is the next place, and no motion.
                velocity = moves if math.hypot(*moves) <= guard.mission.limits.max_speed_m_s else None
        guard.asked, guard.others_setpoint_us = Asked(place, velocity), now_us

    def hear_choice(self) -> None:
        """A client has asked for a mode."""
        self.core.flight.awaits_choice = False

    def hear_interval(self, message_id: int | None, interval_us: int) -> None:
        """A client has asked for a stream, or for a group: None. What the guard needs more often it asks for again."""
        for own_id, request in self.core.flight.streams.asked.items():
            is_enough = 0 < interval_us <= request.parameters[1]
            if message_id in (own_id, None) and not is_enough:
                self.core.flight.outbox.append(SendCommand(request, 0))


# Own setpoints that are remembered until they pass the gate: one for each IMU sample of a second, in which PX4 holds
# the last.
_MOST_ON_THE_WAY = 250
# HEARTBEAT and TIMESYNC: the program's own are already there. It would take an answer to a question of the guard's for
# one to its own, so the round trip is not measured here.
_PROGRAMS_OWN = (0, 111)


class AttachedGuard(Guard):
    """On a program's own connection: hears one vehicle, and keeps others' setpoints for it out while it holds.

    A step that is late by a whole poll shows a stall. The messages that waited then arrive one after the other: all
    that is heard within POLL_INTERVAL_US becomes one step, and no silence is judged before it.
    """

    def __init__(self, config: GuardConfig, system_id: int) -> None:
        super().__init__(config)
        self.core.flight.keeps_others_out = True
        self._source = (system_id, AUTOPILOT_COMPONENT_ID)
        self._own: deque[bytes] = deque(maxlen=_MOST_ON_THE_WAY)  # payloads, in the order in which they were sent
        self.kept_out = 0  # setpoints that did not go on
        self._arrived = b""
        self._drained_us: int | None = None  # after a stall: when what arrived in it has been heard

    def step(self, received: bytes, now_us: int) -> StepResult:
        """Take a packet that has arrived, from whomever, or b"" when only time has passed."""
        if received and source_of(received) == self._source:
            self._arrived += received
        if self._is_draining(now_us):
            return StepResult((), (), ())
        arrived, self._arrived = self._arrived, b""
        result = super().step(arrived, now_us)
        if self.core.flight.vehicle.autopilot is not ASSUMED:
            self.stop("a guard inside a program guards PX4 alone: use `rebound guard --between`")
        sent = [packet for packet in result.sent_frames if message_id_of(packet) not in _PROGRAMS_OWN]
        self._own += [payload_of(packet) for packet in sent if message_id_of(packet) in SETPOINT_IDS]
        return result._replace(sent_frames=tuple(sent))

    def _is_draining(self, now_us: int) -> bool:
        if self._drained_us is None:
            if self._has_begun and now_us - super().next_deadline_us() >= POLL_INTERVAL_US:
                self._drained_us = now_us + POLL_INTERVAL_US
        elif now_us >= self._drained_us:
            self._drained_us = None
        return self._drained_us is not None

    def lets_pass(self, packet: bytes) -> bool:
        """Whether a packet on its way may go on: all but others' setpoints for this vehicle while the guard holds.

        Its own are known by their content, each once.
        """
        if (payload := payload_of(packet)) in self._own:
            while self._own.popleft() != payload:
                pass
            return True
        asked = asked_by(packet) if is_for(packet, self._source[0]) else None
        if asked is None:
            if is_for(packet, self._source[0]) and would_move(packet, self.core.flight.vehicle.autopilot):
                self.hear_choice()
            return True
        is_kept_out = self.core.holds or self.core.flight.awaits_choice
        self.hear_setpoint(asked)
        self.kept_out += is_kept_out
        return not is_kept_out

    def next_deadline_us(self) -> int:
        return super().next_deadline_us() if self._drained_us is None else self._drained_us
