"""Recovery laws: where to come to rest behind what was touched, and whether by a plan or at once.

`paper`, eq. 3: x_d = [x_1(t_c) - gamma_1 v_c1,  x_2(t_c) - gamma_2 v_c2,  x_3(t_c)]. The paper approaches along the
positive axes; read for any approach, gamma_i |v_ci| back along each horizontal axis.

`normal`, eq. 3 along the normal: x_d = x(t_c) + gamma |v_c . n| n + tau, tau = 0 (tangential: damped) or gamma v_t.

`adaptive`, where the vehicle comes to rest. From the motion x, v that follows the contact

    x_d = x + T v,    T = WAY_S

moved clear of all surfaces, by clearance_m off what was hit. T v is the way of the attitude law (see attitude_law),
whatever the attitude's lag. The height is x_3(t_c), unless the obstacle is steep.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.vector import flat, plus, split
from companion.reflex.config import WAY_S, RecoveryConfig
from companion.reflex.surface import Contact, MotionState


@dataclass(frozen=True, slots=True)
class Law:
    """A goal, and how the vehicle comes there."""

    goal_ned_m: Callable[[RecoveryConfig, Contact, MotionState], Vector3]
    follows: bool  # it is found anew as more is known of the contact
    leans: bool  # attitude and thrust are set until the vehicle rests, clear of what it hit; else its own loops fly it


def _paper(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    (gamma_1_s, gamma_2_s), (x_1, x_2, x_3) = config.gamma_per_axis, contact.position_ned_m
    v_c1, v_c2, _ = contact.velocity_ned_m_s
    return (x_1 - gamma_1_s * v_c1, x_2 - gamma_2_s * v_c2, x_3)


def _normal(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    gamma_s = config.gamma_per_axis[0]
    along_m_s, tangential = split(contact.velocity_ned_m_s, contact.normal_ned)
    goal = plus(contact.position_ned_m, gamma_s * abs(along_m_s), contact.normal_ned)
    return plus(goal, gamma_s, flat(tangential)) if config.tangential == "kept" else goal


def _adaptive(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    goal, normal = plus(motion.position_ned_m, WAY_S, motion.velocity_ned_m_s), contact.normal_ned
    if config.tangential == "kept":
        goal = plus(goal, config.gamma_per_axis[0], split(motion.velocity_ned_m_s, normal)[1])
    return (goal[0], goal[1], contact.position_ned_m[2] if normal[2] == 0.0 else goal[2])


RECOVERY_LAWS: Mapping[str, Law] = {
    "paper": Law(_paper, follows=False, leans=False),
    "normal": Law(_normal, follows=True, leans=False),
    "adaptive": Law(_adaptive, follows=True, leans=True),
}
