"""State returning: home to above the arming position, on the watch for hits; landing follows."""

import math
from dataclasses import replace

from companion.flight.around import home_around
from companion.flight.context import FlightContext, Inputs, Move, Target
from companion.flight.course import stay
from companion.flight.remembering import surroundings
from companion.flight.states import Trigger
from companion.flight.trajectory import Trajectory


class FlyHome:
    """Up where that is asked for, then straight; begun anew after each recovery on the way."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        assert flight.target is not None, "the flight is in the air"
        self._flight = flight
        self._began_us = flight.way_us
        flight.going_home = True
        flight.yaw_rad = flight.target.yaw_rad
        start = flight.mission_ned_m(flight.target.position_ned_m)
        pace = replace(flight.pace, factor=1.0).against(flight.leaning.wind_m_s2, (-start[0], -start[1], 0.0))
        planned = home_around(start, flight.returning_as, pace, surroundings(flight))
        self._is_cut_off = planned.way is None
        self._way: Trajectory = planned.way or stay(start)
        if self._is_cut_off:
            flight.unreachable.append("home")
            flight.tell(now_us, "unreachable", "home out of reach: no way round what is known; landing here")
            return
        round_it = " round what is known" if planned.is_detour else ""
        text = f"returning over {self._way.distance_m:.1f} m{round_it}"
        flight.tell(now_us, "return", text, distance_m=self._way.distance_m)

    @property
    def _elapsed_s(self) -> float:
        return (self._flight.way_us - self._began_us) * 1e-6

    def target(self, now_us: int) -> Target | None:
        elapsed_s = self._elapsed_s
        position, velocity, acceleration = self._way.at(elapsed_s)
        place = self._flight.local_ned_m(position)
        if elapsed_s >= self._way.duration_s:
            return Target(place, self._flight.yaw_rad)
        return self._flight.under_way(place, self._flight.yaw_rad, velocity, acceleration)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        if self._is_cut_off:
            return Move(Trigger.LAND_DUE)
        overdue_s = self._elapsed_s - self._way.duration_s
        if overdue_s < 0.0:
            return None
        latest, limits = flight.vehicle.history.latest(), flight.mission.companion.flight
        goal = flight.local_ned_m(self._way.target_m)
        if latest is not None and math.dist(latest.position_ned_m, goal) <= limits.acceptance_radius_m:
            return Move(Trigger.HOME_REACHED)
        if overdue_s > limits.arrival_timeout_s:
            return Move(Trigger.INTERRUPTED, "not arrived at home", hand_over=True)
        return None
