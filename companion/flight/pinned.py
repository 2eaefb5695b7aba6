"""Hanging on what was hit: the vehicle leans into it, and its own thrust holds it there.

A push below the centre turns a vehicle towards the obstacle. Thrust T at a lean a then presses with T sin(a), at a
lever that grows with the lean, and the motors turn it back with at most a tenth of a metre times T: from 48 degrees on
no thrust does (docs/recovery.md). Below that a small one does, which leaves the motors room to differ. A way off the
obstacle that goes on by the clock meanwhile soon brakes: it leans the vehicle into what it has never left.
"""

import math
from dataclasses import dataclass

from companion.estimate.rotation import body_to_ned
from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, Target
from companion.messages import Attitude, Vector3
from companion.recovery.height import as_it_moves
from companion.recovery.way import REST

# Sines: of a lean into the obstacle that no hit needs, and of one from which a vehicle is free of it.
HANGING = math.sin(math.radians(20.0))
FREE = math.sin(math.radians(12.0))
# As it will lean by then: what is asked for takes so long to turn it.
AHEAD_S = 0.1
# Later than this after a hit a vehicle may lean so to brake.
BEGUN_US = 200_000
# Down, half of gravity: leaves thrust to steer with.
FALL_M_S2 = 4.9
# Away from the obstacle: a lean of 30 degrees, as PX4 leans as if it hovered (MPC_ACC_DECOUPLE).
AWAY_M_S2 = 5.6
# What a fall is stopped with, hovering at 78 % of the thrust and not yet level, and what is to be left of the height.
STOPPING_M_S2 = 2.0
LEFT_M = 0.3
# A vehicle that has not come free by then lies on what it hit, or on the ground.
LONGEST_US = 1_000_000


@dataclass(slots=True)
class Hanging:
    """Followed from the hit on; `since_us` on the clock of `step`'s ``now_us``, None while the vehicle does not.

    One that is only about to keeps its height: the turn that most hits give is soon over, and to go away is enough.
    """

    since_us: int | None = None
    is_leant: bool = False  # by so much already

    def step(self, attitude: Attitude, normal_ned: Vector3, since_hit_us: int, now_us: int) -> bool:
        """Whether the vehicle hangs on an obstacle with this horizontal normal."""
        n, e, d = body_to_ned(attitude.attitude_wxyz, (0.0, 0.0, -1.0))
        into = -(n * normal_ned[0] + e * normal_ned[1])
        self.is_leant = into > HANGING
        if attitude.angular_velocity_frd_rad_s is not None:
            p, q, r = body_to_ned(attitude.attitude_wxyz, attitude.angular_velocity_frd_rad_s)
            into -= AHEAD_S * ((q * d - r * e) * normal_ned[0] + (r * n - p * d) * normal_ned[1])
        if self.since_us is None:
            self.since_us = now_us if into > HANGING and since_hit_us < BEGUN_US else None
        elif into < FREE or now_us - self.since_us > LONGEST_US:
            self.since_us = None
        return self.since_us is not None


def has_room_below(flight: FlightContext) -> bool:
    """Whether a fall can still be stopped above the ground."""
    latest, height_m = flight.vehicle.history.latest(), flight.height_m
    if latest is None or height_m is None:
        return False
    down_m_s = max(0.0, latest.velocity_ned_m_s[2])
    return height_m > LEFT_M + 0.5 * down_m_s**2 / STOPPING_M_S2


def let_go(record: CollisionRecord, normal_ned: Vector3, yaw_rad: float | None, falls: bool, reckons: bool) -> Target:
    """What to ask for meanwhile: away, and either a fall or the height, as reckoned where the estimate is not it."""
    climb = record.climb
    reckons &= climb.is_reckoned
    if falls:
        climb.hold(FALL_M_S2)
    down_m_s2 = FALL_M_S2 if falls else climb.braking_m_s2() if reckons else 0.0
    away = (AWAY_M_S2 * normal_ned[0], AWAY_M_S2 * normal_ned[1], down_m_s2)
    is_free = falls or reckons
    velocity = as_it_moves(record.estimated_down_m_s) if is_free else REST
    return Target(record.setpoint_ned_m, yaw_rad, velocity, away, leans_only=True, is_height_free=is_free)
