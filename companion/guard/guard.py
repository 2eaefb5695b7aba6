"""The guard as a step function: bytes and the time in, bytes and events out."""

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

from companion.autopilot.known import defaults
from companion.companion import Stepped
from companion.guard.between import Between
from companion.guard.config import GuardConfig
from companion.guard.machine import GuardCore
from companion.mavlink.readers import GUARD_READERS
from companion.messages import Asked, SendCommand
from companion.motion.vector import ZERO, minus, plus

# Setpoints are lost when there is none for so long.
LONGEST_BETWEEN_S = defaults.LOSS_US * 1e-6


class Guard(Stepped[GuardCore]):
    """On a link of its own, or between the vehicle and its clients, whose packets pass it (see guard.between)."""

    def __init__(self, config: GuardConfig) -> None:
        super().__init__(GuardCore(config), GUARD_READERS)
        self._shift_ned_m = ZERO  # of the local frame, when the last setpoint came

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
        before, before_us = guard.asked, guard.others_setpoint_us
        if shift != self._shift_ned_m:
            # The frame has moved since the one before, and not the place.
            self._shift_ned_m, before_us = shift, None
        if asked.place_ned_m is not None:
            asked = replace(asked, place_ned_m=minus(asked.place_ned_m, shift))
        guard.asked, guard.others_setpoint_us = asked, now_us
        if before is None or before.place_ned_m is None or asked.place_ned_m is None or before_us is None:
            return
        since_s = (now_us - before_us) * 1e-6
        if asked.velocity_ned_m_s is None and 0.0 < since_s < LONGEST_BETWEEN_S:
            velocity = plus(ZERO, 1.0 / since_s, minus(asked.place_ned_m, before.place_ned_m))
            # What goes faster than a vehicle is the next place, and no motion.
            if math.hypot(*velocity) <= guard.mission.limits.max_speed_m_s:
                guard.asked = replace(asked, velocity_ned_m_s=velocity)

    def hear_choice(self) -> None:
        """A client has asked for a mode."""
        self.core.flight.awaits_choice = False

    def hear_interval(self, message_id: int | None, interval_us: int) -> None:
        """A client has asked the vehicle for a stream, or for a group: None. What the guard needs more often it asks
        for again.
        """
        for own_id, request in self.core.flight.streams.asked.items():
            is_enough = 0 < interval_us <= request.parameters[1]
            if message_id in (own_id, None) and not is_enough:
                self.core.flight.outbox.append(SendCommand(request, 0))
