"""State returning: home to above the arming position, on the watch for hits; landing follows."""

import math
from dataclasses import replace

from companion.flight.context import FlightContext, Inputs, Move, Target
from companion.flight.course import way_home
from companion.flight.states import Trigger


class FlyHome:
    """Up where that is asked for, then straight; begun anew after each recovery on the way."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        assert flight.target is not None, "the flight is in the air"
        self._flight = flight
        self._started_us = now_us
        flight.going_home = True
        flight.yaw_rad = flight.target.yaw_rad
        start = flight.mission_ned_m(flight.target.position_ned_m)
        self._way = way_home(start, flight.returning_as, replace(flight.pace, factor=1.0), flight.mission.fence)
        flight.tell(now_us, "return", f"returning over {self._way.distance_m:.1f} m", distance_m=self._way.distance_m)

    def target(self, now_us: int) -> Target | None:
        elapsed_s = (now_us - self._started_us) * 1e-6
        position, velocity, acceleration = self._way.at(elapsed_s)
        place = self._flight.local_ned_m(position)
        if elapsed_s >= self._way.duration_s:
            return Target(place, self._flight.yaw_rad)
        return Target(place, self._flight.yaw_rad, velocity, acceleration)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        overdue_s = (now_us - self._started_us) * 1e-6 - self._way.duration_s
        if overdue_s < 0.0:
            return None
        latest, limits = flight.vehicle.history.latest(), flight.mission.companion.flight
        goal = flight.local_ned_m(self._way.target_m)
        if latest is not None and math.dist(latest.position_ned_m, goal) <= limits.acceptance_radius_m:
            return Move(Trigger.HOME_REACHED)
        if overdue_s > limits.arrival_timeout_s:
            return Move(Trigger.INTERRUPTED, "not arrived at home", hand_over=True)
        return None
