"""Recovery law `adaptive`: as near as is safe, by a way that the vehicle can follow.

From the motion x, v, a that follows the contact, with v_t the part of v along the obstacle, of normal n:

    r   = v T / 2 + a T^2 / 12,  r_t what of it is along the obstacle
    D   = max(d_0 + sin(10 deg) |v_t| T / 2,  t_0 |v_c . n|,  (x - x(t_c) + r) . n)
    x_d = x + (D - (x - x(t_c)) . n) n + r_t,  height x_3(t_c) unless the obstacle is steep

that is, d_0 (clearance_m), and what a normal good to 10 degrees may take of it along the obstacle, or t_0 |v_c . n|
(clearance_s) off the obstacle, further where the rebound would carry the vehicle further before it could stop, and
along the obstacle where it comes to rest. v T / 2 is the length of a glide that only brakes. The way is a quintic from
x, v, a to rest (way.Glide), sent with its velocity and acceleration, and T the shortest duration from 1.25 s on for
which its acceleration stays within a_max. At first the motion is the one expected: x(t_c), u = e |v_c . n| with the
airframe's restitution e, v_t of the approach. It is measured once the contact is over, and goal and way found anew.
"""

import math

from companion.messages import Vector3
from companion.recovery.direction import plus, split
from companion.recovery.interface import Contact, Moving, RecoveryConfig
from companion.recovery.way import REST, SHORTEST_S, STEP, Way, glide, most_of

# Of the limit. However long a way is, taking back a lean asks for 0.36 of it: from 2.8 on none keeps to the limit, and
# the length that was looked for had no end.
MOST_LEANT = 2.0
# Of 10 degrees: as well as the normal is known after most hits (docs/detection.md).
NORMAL_SINE = 0.17


class AdaptiveLaw:
    """Twice a collision: with the rebound expected, and with the one measured."""

    name = "adaptive"
    is_refined = True
    holds_height = True

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config

    def expected(self, contact: Contact) -> Moving:
        off_m_s, tangential = split(contact.velocity_ned_m_s, contact.normal_ned)
        # What leaves already goes on to; what comes in comes back with the share that is given back.
        velocity = plus(tangential, max(off_m_s, -self._config.restitution * off_m_s), contact.normal_ned)
        return Moving(contact.position_ned_m, velocity)

    def goal_ned_m(self, contact: Contact, motion: Moving) -> Vector3:
        config, normal = self._config, contact.normal_ned
        off_m_s, tangential = split(motion.velocity_ned_m_s, normal)
        off_m = split(_difference(motion.position_ned_m, contact.position_ned_m), normal)[0]
        into_m_s, _ = split(contact.velocity_ned_m_s, normal)
        harder_m, along_m_s = config.clearance_s * max(0.0, -into_m_s), math.hypot(*tangential)
        if normal[2] == 0.0:
            tangential = (tangential[0], tangential[1], 0.0)
        leant = self._leant(motion)
        leant_m_s2, leant_along = split(leant, normal)
        duration_s, way = SHORTEST_S, REST
        while True:
            clear_m = max(config.clearance_m + NORMAL_SINE * 0.5 * along_m_s * duration_s, harder_m)
            stops_m = 0.5 * off_m_s * duration_s + leant_m_s2 * duration_s**2 / 12.0
            off = plus(REST, max(clear_m - off_m, stops_m), normal)
            way = plus(plus(off, 0.5 * duration_s, tangential), duration_s**2 / 12.0, leant_along)
            if most_of(way, motion.velocity_ned_m_s, leant, duration_s) <= config.acceleration_m_s2:
                break
            duration_s *= STEP
        if config.tangential == "kept":
            way = plus(way, config.gamma_per_axis[0], tangential)
        goal = plus(motion.position_ned_m, 1.0, way)
        return (goal[0], goal[1], contact.position_ned_m[2] if normal[2] == 0.0 else goal[2])

    def way(self, motion: Moving, goal_ned_m: Vector3) -> Way:
        most_m_s2 = self._config.acceleration_m_s2
        return glide(motion.position_ned_m, motion.velocity_ned_m_s, self._leant(motion), goal_ned_m, most_m_s2)

    def _leant(self, motion: Moving) -> Vector3:
        """The acceleration that the way begins with, as far as a way can take it back."""
        leant, most_m_s2 = motion.acceleration_ned_m_s2, MOST_LEANT * self._config.acceleration_m_s2
        size = math.hypot(*leant)
        return leant if size <= most_m_s2 else plus(REST, most_m_s2 / size, leant)


def _difference(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
