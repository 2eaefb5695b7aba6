"""Recovery law `normal`: eq. 3 along the obstacle's normal instead of back along the approach.

    x_d = x(t_c) + gamma |v_c . n| n + tau,  tau = 0 (tangential: damped) or gamma v_t (tangential: kept)

A glancing hit is answered with little, and the way on along the wall is either given up or not.
"""

from companion.messages import Vector3
from companion.recovery.direction import plus, split
from companion.recovery.interface import Contact, Moving, RecoveryConfig
from companion.recovery.way import AtOnce, Way


class NormalLaw:
    """Along the normal as it was known at the hit and, once the contact has been seen, as it is known then."""

    name = "normal"
    is_refined = True
    holds_height = True

    def __init__(self, config: RecoveryConfig) -> None:
        self._gamma_s = config.gamma_per_axis[0]
        self._keeps = config.tangential == "kept"

    def expected(self, contact: Contact) -> Moving:
        return Moving(contact.position_ned_m, contact.velocity_ned_m_s)

    def goal_ned_m(self, contact: Contact, motion: Moving) -> Vector3:
        along_m_s, tangential = split(contact.velocity_ned_m_s, contact.normal_ned)
        goal = plus(contact.position_ned_m, self._gamma_s * abs(along_m_s), contact.normal_ned)
        if not self._keeps:
            return goal
        return plus(goal, self._gamma_s, (tangential[0], tangential[1], 0.0))

    def way(self, motion: Moving, goal_ned_m: Vector3) -> Way:
        return AtOnce(goal_ned_m)
