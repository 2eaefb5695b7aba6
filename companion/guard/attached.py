"""The guard on a program's own connection: between the program and its vehicle, whose packets both pass it."""

from collections import deque

from companion.autopilot.known import ASSUMED
from companion.companion import StepResult
from companion.flight.core import POLL_INTERVAL_US
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID
from companion.mavlink.moves import SETPOINT_IDS, asked_by, is_for, would_move
from companion.mavlink.packet import message_id_of, payload_of, source_of

# Own setpoints that are remembered until they pass the gate: one for each IMU sample of a second, in which PX4 holds
# the last.
_MOST_ON_THE_WAY = 250
# HEARTBEAT and TIMESYNC: the program's own are already there. It would take an answer to a question of the guard's for
# one to its own, so the round trip is not measured here.
_PROGRAMS_OWN = (0, 111)


class AttachedGuard(Guard):
    """Hears one vehicle, and keeps others' setpoints for it out while it holds.

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
