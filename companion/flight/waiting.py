"""The item `wait_for`: when what it waits for has come."""

import math

from companion.flight.context import FlightContext
from companion.mission.items import SteadyCondition, WaitForItem


class Waiting:
    """Holds the one condition of the item."""

    def __init__(self, item: WaitForItem, flight: FlightContext) -> None:
        self._item = item
        self._steady_since_us: int | None = None
        flight.file_awaited, flight.file_is_there = item.file, False

    def is_over(self, flight: FlightContext, now_us: int) -> bool:
        item = self._item
        if item.flight_time_s is not None:
            assert flight.armed_at_us is not None
            return now_us - flight.armed_at_us >= item.flight_time_s * 1e6
        if item.steady is not None:
            return self._is_steady(item.steady, flight, now_us)
        # A hit ends the step by the mission's policy, as it does every other.
        if flight.file_is_there:
            flight.file_awaited = None
        return flight.file_is_there

    def _is_steady(self, steady: SteadyCondition, flight: FlightContext, now_us: int) -> bool:
        latest, target = flight.vehicle.history.latest(), flight.target
        assert latest is not None and target is not None, "the flight is in the air"
        rests = (
            math.dist(latest.position_ned_m, target.position_ned_m) <= steady.within_m
            and math.hypot(*latest.velocity_ned_m_s) <= steady.speed_m_s
        )
        if not rests:
            self._steady_since_us = None
        elif self._steady_since_us is None:
            self._steady_since_us = now_us
        return self._steady_since_us is not None and now_us - self._steady_since_us >= steady.for_s * 1e6
