"""Height through a hit: what climbs or falls after it is braked by an acceleration of its own, sent ahead.

A vehicle that leans into its flight is hit below its centre. The push throws its nose down, the wall's friction holds
the nose, and so the whole vehicle is thrown up: at 5 m/s with 0.6 m/s, within the contact. The velocity loop alone,
asked for nothing but its height, brakes that as w' = -k w and rises w / k. With an acceleration a against it,

    w' = -k w - a    until    t_1 = ln(1 + k w / a) / k
"""

import math
from dataclasses import dataclass

from companion.estimate.rotation import body_to_ned
from companion.estimate.strapdown import Strapdown
from companion.messages import Vector3
from companion.recovery.way import REST, Motion

# PX4's MPC_Z_VEL_P_ACC.
VELOCITY_GAIN_PER_S = 4.0
# Three times a good velocity estimate's noise: what is slower needs no help.
LEAST_M_S = 0.1
# The estimate is 0.02 s late and the motors follow with 0.02 s: what is asked for must end by so much sooner.
LATE_S = 0.04
# PX4 falls with 8.3 m/s^2 at most: its MPC_THR_MIN, 0.12, of a hover at 0.78.
FALLING_MOST_M_S2 = 8.0
# The attitude's loop takes the turn of a hit away within 0.1 s; a second guard swings in after 0.03 s.
THROWN_US = 30_000
# Of rate times reach, what throws the vehicle up: in hits in simulation 0.82 where the guards stay where they are, two
# of them 0.81 of the reach ahead, and 0.67 where their arms fold, within 5 %; an arm pushes for longer than a rigid
# guard's millisecond.
STUCK_SHARE, FOLDED_SHARE, FOLDS_US = 0.82, 0.67, 5_000
# And more the faster the hit turned it about its yaw, as then one guard beside the middle was hit.
BESIDE_S = 0.014
# What hits in simulation throw up at most, by the speed into the obstacle squared times the sine of the lean into it:
# walls at 2 to 5 m/s 0.07 to 0.18 1/(m/s), poles and edges no more. There one guard is hit, and the rates show a spin.
THROWN_MOST_S_PER_M, THROWN_ALLOWED_M_S = 0.18, 0.05
# Above a third of the usual range parts of a push may be clipped.
LOUD_M_S2 = 50.0
# Motors follow with 0.02 s, and what is asked waits 0.01 s for the vehicle's position loop.
LAG_S = 0.03
# What is left of a climb is to end within this: a setpoint's interval.
WITHIN_S = 0.03
# As PX4's MPC_Z_P.
HEIGHT_PER_S = 1.0
# Half a second after a hit an estimate swings about the truth with a tenth of what it was wrong by at first; what is
# reckoned goes on drifting.
TOLD_US = 450_000
TOLD_PER_S = 3.5
# Setpoints leave at their rate; a brake that is wrong by this costs 2 cm/s in half an interval.
PRESSING_M_S2 = 2.0
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


def thrown_down_m_s(rates_ned_rad_s: Vector3, normal_ned: Vector3, reach_m: float) -> float:
    """How fast a vehicle is thrown, down positive, whose guard sticks to an obstacle while the hit turns it.

    The guard is at -reach n and does not move up or down: w = -(rates x (-reach n))_z.
    """
    return reach_m * (rates_ned_rad_s[0] * normal_ned[1] - rates_ned_rad_s[1] * normal_ned[0])


def most_thrown_m_s(into_m_s: float, lean_in: float) -> float:
    """How fast at most a hit with a speed into the obstacle throws up a vehicle that leans into it, by this sine."""
    return THROWN_ALLOWED_M_S + THROWN_MOST_S_PER_M * into_m_s * into_m_s * max(0.0, lean_in)


@dataclass(slots=True)
class Climb:
    """How a vehicle moves up or down after a hit that its estimate does not know, down positive; SI.

    The hit itself, of which the accelerometer clips most, by the gyroscopes, which do not clip; what follows, by the
    accelerometer. Changed only by `hear` and by `braking_m_s2` or `hold`, one of them whenever a setpoint leaves.
    """

    hit_boot_us: int
    normal_ned: Vector3
    reach_m: float
    upwards_m_s2: float
    speed_m_s: float
    most_m_s: float = math.inf
    """Faster the hit cannot have thrown it up, by how it was met (`most_thrown_m_s`)."""
    thrown_m_s: float = 0.0
    fallen_m: float = 0.0
    asked_m_s2: float = 0.0
    coming_m_s: float = 0.0  # of what was asked, what has not come about yet
    is_held: bool = False  # something else is asked for
    was_loud: bool = True  # the sample before
    time_boot_us: int = 0
    sum_m_s: float = 0.0

    @property
    def is_reckoned(self) -> bool:
        return self.upwards_m_s2 > 0.0

    @property
    def is_thrown(self) -> bool:
        return self.is_reckoned and self.thrown_m_s <= -LEAST_M_S

    @property
    def is_pressing(self) -> bool:
        """Whether what was asked last is so wrong that the next setpoint's turn is too late."""
        is_new = self.time_boot_us - self.hit_boot_us <= BRAKED_US
        return (
            is_new
            and self.is_thrown
            and not self.is_held
            and abs(self._wanted_m_s2() - self.asked_m_s2) >= PRESSING_M_S2
        )

    def hear(self, strapdown: Strapdown, pushed_us: int, told_m_s: float | None = None) -> None:
        """What the newest sample adds; `pushed_us`: how long the contact has lasted; `told_m_s`: by the estimate."""
        time_us, sum_m_s = strapdown.time_boot_us, strapdown.sum_ned_m_s[2]
        if self.time_boot_us == 0:
            self.time_boot_us, self.sum_m_s = time_us, sum_m_s
        elapsed_s = 1e-6 * (time_us - self.time_boot_us)
        thrown_m_s = self._thrown_m_s(strapdown, pushed_us)
        is_loud = math.hypot(*strapdown.acceleration_ned_m_s2) >= LOUD_M_S2
        if time_us - self.hit_boot_us <= THROWN_US and thrown_m_s < min(self.thrown_m_s, self.speed_m_s):
            self.thrown_m_s = self.speed_m_s = thrown_m_s
        elif not (is_loud or self.was_loud):  # the sum adds half of the sample before
            self.speed_m_s += sum_m_s - self.sum_m_s
        self.was_loud = is_loud
        if told_m_s is not None and time_us - self.hit_boot_us >= TOLD_US:
            self.speed_m_s += TOLD_PER_S * elapsed_s * (told_m_s - self.speed_m_s)
        self.fallen_m += elapsed_s * self.speed_m_s
        self.coming_m_s += elapsed_s * (self.asked_m_s2 - self.coming_m_s / LAG_S)
        self.time_boot_us, self.sum_m_s = time_us, sum_m_s

    def _thrown_m_s(self, strapdown: Strapdown, pushed_us: int) -> float:
        rates_ned = body_to_ned(strapdown.attitude_wxyz, strapdown.rates_frd_rad_s)
        share = (FOLDED_SHARE if pushed_us >= FOLDS_US else STUCK_SHARE) + BESIDE_S * abs(rates_ned[2])
        return max(share * thrown_down_m_s(rates_ned, self.normal_ned, self.reach_m), -self.most_m_s)

    def _wanted_m_s2(self) -> float:
        wanted = -(self.speed_m_s + self.coming_m_s + HEIGHT_PER_S * self.fallen_m) / WITHIN_S
        return min(max(wanted, -self.upwards_m_s2), FALLING_MOST_M_S2)

    def braking_m_s2(self) -> float:
        """The acceleration to ask for now, which ends the climb and brings the height back."""
        self.asked_m_s2, self.is_held = self._wanted_m_s2(), False
        return self.asked_m_s2

    def hold(self, asked_m_s2: float) -> None:
        """Another acceleration is asked for."""
        self.asked_m_s2, self.is_held = asked_m_s2, True


def level(motion: Motion, down_m: float, braking_down_m_s2: float) -> Motion:
    """The motion's horizontal part, at a height, with a braking acceleration."""
    n, e, _ = motion.position_ned_m
    if motion.velocity_ned_m_s is None and braking_down_m_s2 == 0.0:
        return Motion((n, e, down_m))
    u, v, _ = motion.velocity_ned_m_s or REST
    a, b, _ = motion.acceleration_ned_m_s2 or REST
    return Motion((n, e, down_m), (u, v, 0.0), (a, b, braking_down_m_s2))
