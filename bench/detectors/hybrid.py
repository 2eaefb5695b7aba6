"""Detector `hybrid`: force by the accelerometer, torque by the angular momentum.

After T. Tomic, C. Ott and S. Haddadin, "External Wrench Estimation, Collision Detection, and Reflex Reaction for
Flying Robots" (IEEE Transactions on Robotics 33(6), 2017). The force needs no velocity,

    F_ext / m = f - T / m                  low-passed at the gain K_f: F' = K_f (f - T / m - F),

the torque is the residual of the angular momentum J w with the commanded moment tau,

    r = K_t [ J w - integral of (tau + J w x w + r) dt ].

A collision is what is faster than wind: the force's departure from its own low-pass must exceed a threshold. MAVLink
does not tell tau; what the controllers can ask for is inside the torque's threshold instead. Of J only its ratio to the
torque matters: r is kept as an angular acceleration, rad/s^2; the gyroscopic term, small beside a hit, is left out.

Checked: both equations, signs included, are those of LAAS-CNRS's observer after this article (phynt-genom3), read as
program; that one has the measured torques and the gyroscopic term, and decides on no collision. The article's text was
not at hand: how it tells collisions from wind, its gains and its thresholds were not checked. Those here, and what is
left out above, are this project's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bench.detectors.contact import Baseline, BaselineState, judge
from companion.messages import ImuSample, MessageId, Vector3
from companion.motion.vector import ZERO
from companion.reflex.detector import Impact, Situation

# A contact's first sample shows 70 % of itself at 250 Hz, all of it at 50 Hz.
FORCE_GAIN_PER_S = 300.0
# Wind: what is slower than 2 Hz.
WIND_GAIN_PER_S = 12.0
# Motors at full moment make 200 rad/s^2; nothing that flies by itself needs more.
TORQUE_THRESHOLD_RAD_S2, TORQUE_GAIN_PER_S = 400.0, 100.0


@dataclass(slots=True)
class HybridState(BaselineState):
    """Adds the observers; body FRD, changed in place."""

    force_m_s2: Vector3 = ZERO
    wind_m_s2: Vector3 = ZERO
    rates_rad_s: Vector3 | None = None
    turning_rad_s2: Vector3 = ZERO


class HybridDetector(Baseline):
    """See the module's text."""

    name, state = "hybrid", HybridState
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "the z axis is not watched, so pushes from above and below are not seen"
    }

    def look(self, s: HybridState, sample: ImuSample, situation: Situation) -> Impact | None:
        now_us, free_until_us = sample.time_boot_us, self.free_until_us(s, sample.time_boot_us)
        dt_s = min(max(now_us - s.last_sample_boot_us, 1), 50_000) * 1e-6
        push = self._force(s, sample, dt_s)
        turning = self._torque(s, sample.angular_velocity_frd_rad_s, dt_s)
        size = math.sqrt(push[0] ** 2 + push[1] ** 2 + push[2] ** 2)
        is_loud = size >= s.threshold_m_s2 or turning >= TORQUE_THRESHOLD_RAD_S2
        return judge(s, now_us, free_until_us, push, size, is_loud, situation.off_reason)

    def _force(self, s: HybridState, sample: ImuSample, dt_s: float) -> Vector3:
        """The observer's step; the force beyond wind, m/s^2."""
        f_x, f_y, f_z = sample.specific_force_frd_m_s2
        s.thrust.learn(sample.time_boot_us, -f_z, dt_s)
        # Without a thrust to go by the observer sees none of the axis that it acts on.
        external = (f_x, f_y, f_z - s.thrust.expected_m_s2(sample.time_boot_us, f_z))
        s.force_m_s2 = force = _followed(s.force_m_s2, external, FORCE_GAIN_PER_S * dt_s)
        s.wind_m_s2 = wind = _followed(s.wind_m_s2, external, WIND_GAIN_PER_S * dt_s)
        return (force[0] - wind[0], force[1] - wind[1], force[2] - wind[2])

    def _torque(self, s: HybridState, w: Vector3, dt_s: float) -> float:
        """The residual r' = K_t (w' - r); its size, rad/s^2."""
        before = s.rates_rad_s or w
        s.rates_rad_s = w
        change = ((w[0] - before[0]) / dt_s, (w[1] - before[1]) / dt_s, (w[2] - before[2]) / dt_s)
        s.turning_rad_s2 = r = _followed(s.turning_rad_s2, change, TORQUE_GAIN_PER_S * dt_s)
        return math.sqrt(r[0] ** 2 + r[1] ** 2 + r[2] ** 2)


def _followed(old: Vector3, new: Vector3, gain: float) -> Vector3:
    """One step of a first-order low-pass: exact in time, so that no rate makes it unstable."""
    share = 1.0 - math.exp(-gain)
    return (old[0] + share * (new[0] - old[0]), old[1] + share * (new[1] - old[1]), old[2] + share * (new[2] - old[2]))
