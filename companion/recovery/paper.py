"""Recovery law `paper`: eq. 3 of the paper.

    x_d = [x_1(t_c) - gamma_1 |v_c1|,  x_2(t_c) - gamma_2 |v_c2|,  x_3(t_c)]

The paper approaches along the positive axes. Read for any approach, "in an opposite direction to that of the
approach" gives |v_ci| the sign of v_ci, and the setpoint lies gamma_i |v_ci| back along each horizontal axis.
"""

from companion.messages import Vector3
from companion.recovery.interface import Contact, Moving, RecoveryConfig
from companion.recovery.way import AtOnce, Way


class PaperLaw:
    """Eq. 3; once a collision."""

    name = "paper"
    is_refined = False
    holds_height = False

    def __init__(self, config: RecoveryConfig) -> None:
        self._gamma_1_s, self._gamma_2_s = config.gamma_per_axis

    def expected(self, contact: Contact) -> Moving:
        return Moving(contact.position_ned_m, contact.velocity_ned_m_s)

    def goal_ned_m(self, contact: Contact, motion: Moving) -> Vector3:
        x_1, x_2, x_3 = contact.position_ned_m
        v_c1, v_c2, _ = contact.velocity_ned_m_s
        return (x_1 - self._gamma_1_s * v_c1, x_2 - self._gamma_2_s * v_c2, x_3)

    def way(self, motion: Moving, goal_ned_m: Vector3) -> Way:
        return AtOnce(goal_ned_m)
