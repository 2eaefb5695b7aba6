"""A pilot who flies hard by sticks: takes off, strokes, and back before it is too far or low."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.fly.by_hand.watched import STICKS_S, GuardedFlight, Sticks
from companion.motion.config import GRAVITY_M_S2
from sim_vehicle.airframe import Airframe

Floats = np.ndarray[Any, np.dtype[np.float64]]

FLOWN_S = 60.0
ARM_FROM_S, ASK_AGAIN_S, BEGIN_WITHIN_S = 6.0, 0.5, 40.0
# Vigorous flight begins at the first height, and stays between the other two and within a radius.
BEGUN_M, LOWEST_M, HIGHEST_M, RADIUS_M = 12.0, 8.0, 40.0, 80.0
# A stroke of the sticks lasts from a flick to a turn; a hand is never quite still (Ornstein-Uhlenbeck).
STROKE_S, HAND_MEMORY_S, HAND_SHAKE = (0.15, 1.5), 0.3, 0.12
STROKES, STROKE_SHARES = ("full", "part", "reversed", "released"), (0.35, 0.25, 0.25, 0.15)
# How a pilot holds the tilt by rates, and the climb by the throttle.
CLIMB_P_PER_S = 2.0


class Pilot:
    """Flies wishes, as deflections that a self-levelling vehicle would be given, in whatever mode; and comes back."""

    def __init__(
        self,
        flight: GuardedFlight,
        airframe: Airframe,
        parameters: dict[str, float],
        wished: Iterator[Sticks],
        mode: str,
    ) -> None:
        self._flight, self._wished, self._mode = flight, wished, mode
        self._body = flight.vehicle.state.body
        self._hover, self._climb_m_s = airframe.hover_fraction, airframe.control.climb_max_m_s
        self._speed_m_s = parameters["MPC_VEL_MANUAL"]
        self._chosen = mode
        self._next = self._idle
        self._ask_mode_s, self._arm_s, self._end_s = 0.0, ARM_FROM_S, BEGIN_WITHIN_S
        self._tilts_deg: list[float] = []

    def fly(self) -> list[float]:
        """The tilts (deg) of the vigorous part, one every STICKS_S."""
        while self._flight.time_s < self._end_s:
            self._flight.fly_sticks(self._decide)
            self._flight.step()
        return self._tilts_deg

    def _decide(self) -> Sticks:
        """What to ask for, and where the sticks are."""
        flight, status, now_s = self._flight, self._flight.status, self._flight.time_s
        if status.vehicle_mode != self._chosen and now_s >= self._ask_mode_s:
            flight.station.set_mode(self._chosen)
            self._ask_mode_s = now_s + ASK_AGAIN_S
        if not status.armed and now_s >= self._arm_s:
            flight.station.arm()
            self._arm_s = now_s + ASK_AGAIN_S
        if self._next == self._idle and status.armed:
            self._next = self._rise
        if self._next == self._rise and flight.height_m > BEGUN_M:
            self._next, self._chosen, self._end_s = self._vigorous, self._mode, now_s + FLOWN_S
            flight.looks_for_ground = True
        if self._next == self._vigorous:
            self._tilts_deg.append(flight.tilt_deg)
        for watcher in flight.watchers:
            watcher.guard.core.flight.program_elsewhere = True  # a hit is reported, and nobody takes the vehicle over
        return self._next()

    def _idle(self) -> Sticks:
        return Sticks(throttle=-1.0)

    def _rise(self) -> Sticks:
        return self._in_mode(Sticks(throttle=0.7))

    def _vigorous(self) -> Sticks:
        wish = next(self._wished)
        north, east, _ = self._body[0:3].tolist()
        v_north, v_east, _ = flight_velocity = self._flight.velocity_ned_m_s
        is_away = math.hypot(north, east) > RADIUS_M and north * v_north + east * v_east > 0.0
        roll, pitch = wish.roll, wish.pitch
        if is_away or math.hypot(*flight_velocity[:2]) > 1.2 * self._speed_m_s:
            # Full deflection against the way it goes.
            forward, right = self._in_heading(-v_north, -v_east)
            size = max(math.hypot(forward, right), 1e-3)
            roll, pitch = right / size, forward / size
        throttle = wish.throttle
        if self._flight.height_m < LOWEST_M:
            throttle = max(throttle, 1.0)
        elif self._flight.height_m > HIGHEST_M:
            throttle = min(throttle, -0.5)
        return self._in_mode(Sticks(roll, pitch, throttle, wish.yaw))

    def _in_mode(self, wish: Sticks) -> Sticks:
        if self._flight.status.vehicle_mode != "STABILIZED":
            return wish
        climbs_m_s = -self._flight.velocity_ned_m_s[2]
        asked_m_s2 = CLIMB_P_PER_S * (wish.throttle * self._climb_m_s - climbs_m_s)
        upright = max(math.cos(math.radians(self._flight.tilt_deg)), 0.5)
        thrust = self._hover / upright * max(1.0 + asked_m_s2 / GRAVITY_M_S2, 0.1)
        # MPC_THR_CURVE has hovering in the middle.
        above = thrust - self._hover
        throttle = above / (1.0 - self._hover) if above > 0.0 else above / self._hover
        return Sticks(wish.roll, wish.pitch, throttle, wish.yaw)

    def _in_heading(self, north: float, east: float) -> tuple[float, float]:
        w, x, y, z = self._body[6:10].tolist()
        yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        return cos * north + sin * east, cos * east - sin * north


def wishes(rng: np.random.Generator) -> Iterator[Sticks]:
    """One every STICKS_S: strokes on each stick for itself, roll and pitch together, under a hand never still."""
    targets, shake, until_s = np.zeros(4), np.zeros(4), np.zeros(3)
    stick_groups, time_s = (np.array([0, 1]), np.array([2]), np.array([3])), 0.0
    while True:
        for group, sticks in enumerate(stick_groups):
            if time_s >= until_s[group]:
                targets[sticks] = _stroke(targets[sticks], rng)
                until_s[group] = time_s + rng.uniform(*STROKE_S)
        shake += -shake * STICKS_S / HAND_MEMORY_S
        shake += HAND_SHAKE * math.sqrt(2.0 * STICKS_S / HAND_MEMORY_S) * rng.standard_normal(4)
        yield Sticks(*np.clip(targets + shake, -1.0, 1.0).tolist())
        time_s += STICKS_S


def _stroke(before: Floats, rng: np.random.Generator) -> Floats:
    kind = rng.choice(STROKES, p=STROKE_SHARES)
    if kind == "reversed":
        return -before
    if kind == "released":
        return 0.0 * before
    way = rng.standard_normal(len(before))
    size = 1.0 if kind == "full" else rng.uniform(0.2, 1.0)
    stroke: Floats = size * way / max(float(np.linalg.norm(way)), 1e-9)
    return stroke
