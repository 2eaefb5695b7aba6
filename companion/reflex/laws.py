"""Recovery laws: where to come to rest behind what was touched, and whether by a plan or at once.

`paper`, eq. 3: x_d = [x_1(t_c) - gamma_1 v_c1,  x_2(t_c) - gamma_2 v_c2,  x_3(t_c)]. The paper approaches along the
positive axes; read for any approach, gamma_i |v_ci| back along each horizontal axis.

`normal`, eq. 3 along the normal: x_d = x(t_c) + gamma |v_c . n| n + tau, tau = 0 (tangential: damped) or gamma v_t.

`adaptive`, as near as is safe. From the motion x, v, a that follows the contact, with v_t the part of v along it:

    r   = v T / 2 + a T^2 / 12,  r_t what of it is along the obstacle
    D   = max(d_0,  t_0 |v_c . n|,  (x - x(t_c) + r) . n)
    x_d = x + (D - (x - x(t_c)) . n) n + r_t,  height x_3(t_c) unless the obstacle is steep

that is d_0 (clearance_m) or t_0 |v_c . n| (clearance_s) off the obstacle, further where the rebound would carry the
vehicle further before it could stop, and along the obstacle where it comes to rest.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from companion.messages import Vector3
from companion.reflex.config import RecoveryConfig
from companion.reflex.halfspace import plus, split
from companion.reflex.planner import MotionState, shortest


@dataclass(frozen=True, slots=True)
class Contact:
    """The vehicle at the time of contact t_c: x(t_c), v_c, and the obstacle's outward normal; NED, SI.

    The normal is horizontal, or the obstacle's own where that is steep (see halfspace.away_from); zero: not known.
    """

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    normal_ned: Vector3
    normal_error_rad: float = 0.0

    def rebound(self, restitution: float) -> MotionState:
        """The motion after it, as far as that can be known before it has been measured."""
        into_m_s, tangential = split(self.velocity_ned_m_s, self.normal_ned)
        back_m_s = max(into_m_s, -restitution * into_m_s)
        return MotionState(self.position_ned_m, plus(tangential, back_m_s, self.normal_ned))


@dataclass(frozen=True, slots=True)
class Law:
    """`follows`: goal and plan are found anew as more is known of the contact. `plans`: else the goal is asked for at
    once, from the first moment on."""

    goal_ned_m: Callable[[RecoveryConfig, Contact, MotionState], Vector3]
    follows: bool
    plans: bool


def _paper(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    (gamma_1_s, gamma_2_s), (x_1, x_2, x_3) = config.gamma_per_axis, contact.position_ned_m
    v_c1, v_c2, _ = contact.velocity_ned_m_s
    return (x_1 - gamma_1_s * v_c1, x_2 - gamma_2_s * v_c2, x_3)


def _normal(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    gamma_s = config.gamma_per_axis[0]
    along_m_s, tangential = split(contact.velocity_ned_m_s, contact.normal_ned)
    goal = plus(contact.position_ned_m, gamma_s * abs(along_m_s), contact.normal_ned)
    return plus(goal, gamma_s, (tangential[0], tangential[1], 0.0)) if config.tangential == "kept" else goal


def _adaptive(config: RecoveryConfig, contact: Contact, motion: MotionState) -> Vector3:
    normal, x = contact.normal_ned, motion.position_ned_m
    off_m_s, tangential = split(motion.velocity_ned_m_s, normal)
    off_m = split(plus(x, -1.0, contact.position_ned_m), normal)[0]
    clear_m = max(config.clearance_m, -config.clearance_s * split(contact.velocity_ned_m_s, normal)[0])
    if normal[2] == 0.0:
        tangential = (tangential[0], tangential[1], 0.0)
    leant_m_s2, leant_along = split(motion.acceleration_ned_m_s2, normal)

    def goal_after(duration_s: float) -> Vector3:
        stops_m = 0.5 * off_m_s * duration_s + leant_m_s2 * duration_s**2 / 12.0
        goal = plus(x, max(clear_m - off_m, stops_m), normal)
        return plus(plus(goal, 0.5 * duration_s, tangential), duration_s**2 / 12.0, leant_along)

    goal = shortest(motion, goal_after, config.acceleration_m_s2).goal_ned_m
    if config.tangential == "kept":
        goal = plus(goal, config.gamma_per_axis[0], tangential)
    return (goal[0], goal[1], contact.position_ned_m[2] if normal[2] == 0.0 else goal[2])


RECOVERY_LAWS: Mapping[str, Law] = {
    "paper": Law(_paper, follows=False, plans=False),
    "normal": Law(_normal, follows=True, plans=False),
    "adaptive": Law(_adaptive, follows=True, plans=True),
}
