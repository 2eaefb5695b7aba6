"""Height through a hit: what climbs or falls after it is braked by an acceleration of its own, sent ahead.

A vehicle that leans into its flight is hit below its centre. The push throws its nose down, the wall's friction holds
the nose, and so the whole vehicle is thrown up: at 5 m/s with 0.6 m/s, within the contact. The velocity loop alone,
asked for nothing but its height, brakes that as w' = -k w and rises w / k. With an acceleration a against it,

    w' = -k w - a    until    t_1 = ln(1 + k w / a) / k
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.recovery.way import REST, Motion

# PX4's MPC_Z_VEL_P_ACC.
VELOCITY_GAIN_PER_S = 4.0
# Three times a good velocity estimate's noise: what is slower needs no help.
LEAST_M_S = 0.1
# The estimate is 0.02 s late and the motors follow with 0.02 s: what is asked for must end by so much sooner.
LATE_S = 0.04
# Later than this it is no longer the hit's doing.
BRAKED_US = 300_000


@dataclass(frozen=True, slots=True)
class Braking:
    """An acceleration, down positive, until a time; `until_us` on the clock of `brake`'s ``now_us``."""

    acceleration_down_m_s2: float = 0.0
    until_us: int = 0

    def at(self, now_us: int) -> float:
        return self.acceleration_down_m_s2 if now_us < self.until_us else 0.0


NO_BRAKING = Braking()


def brake(speed_down_m_s: float, acceleration_m_s2: float, now_us: int) -> Braking:
    """What stops a vehicle that rises (negative) or falls with the speed, besides what its velocity loop does."""
    speed_m_s = abs(speed_down_m_s)
    if speed_m_s < LEAST_M_S or acceleration_m_s2 <= 0.0:
        return NO_BRAKING
    gain_per_s = VELOCITY_GAIN_PER_S
    lasts_s = math.log(1.0 + gain_per_s * speed_m_s / acceleration_m_s2) / gain_per_s - LATE_S
    if lasts_s <= 0.0:
        return NO_BRAKING
    return Braking(-math.copysign(acceleration_m_s2, speed_down_m_s), now_us + round(lasts_s * 1e6))


def as_it_moves(estimated_down_m_s: float) -> Vector3:
    """The velocity to ask for beside an acceleration up or down that is to be had as it is.

    It is what the vehicle takes for its own, right or wrong, so its velocity loop adds nothing. And where nothing comes
    any more, the loop ends what was asked for last at acceleration / gain besides: after 8 m/s^2 a vehicle sinks with
    2 m/s until PX4 misses its setpoints (COM_OF_LOSS_T, 1 s), and not with 8.
    """
    return (0.0, 0.0, estimated_down_m_s)


def level(motion: Motion, down_m: float, braking_down_m_s2: float) -> Motion:
    """The motion's horizontal part, at a height, with a braking acceleration."""
    n, e, _ = motion.position_ned_m
    if motion.velocity_ned_m_s is None and braking_down_m_s2 == 0.0:
        return Motion((n, e, down_m))
    u, v, _ = motion.velocity_ned_m_s or REST
    a, b, _ = motion.acceleration_ned_m_s2 or REST
    return Motion((n, e, down_m), (u, v, 0.0), (a, b, braking_down_m_s2))
