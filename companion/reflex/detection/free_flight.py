"""What free flight teaches: the noise of the specific force on each axis, where the accelerometer is, and the specific
force of full thrust."""

import math
from dataclasses import dataclass, field

from companion.messages import Vector3
from companion.motion.config import CURRENT_US, LONGEST_GAP_US, MOTORS_RAD_S2
from companion.motion.slope import Slope
from companion.motion.vector import ZERO
from companion.reflex import config as reflex


@dataclass(slots=True)
class ForceNoise:
    """Exponentially weighted mean and variance of the specific force on body x, y, z. Changed only by `learn`."""

    mean_frd_m_s2: Vector3 = ZERO
    variance_m2_s4: Vector3 = ZERO
    load_factor: float = 1.0  # mean, by which the variance was learnt
    known_s: float = 0.0
    side_m_s2: float = 0.0  # standard deviation on the noisier of x and y, and a share of z's at least
    vertical_m_s2: float = 0.0  # standard deviation on z

    def learn(self, force_frd_m_s2: Vector3, step_s: float, load_factor: float) -> None:
        """Take one sample, ``step_s`` after the last; the first ones count as a plain mean.

        Rotors that are not balanced shake with the square of their speed, as thrust grows: with the load factor. Others
        shake on when that falls.
        """
        if self.known_s <= 0.0:
            self.mean_frd_m_s2 = force_frd_m_s2
        known_s = self.known_s = min(self.known_s + step_s, reflex.MEMORY_S)
        mean_share, share = step_s / min(known_s, reflex.MEAN_MEMORY_S), step_s / known_s
        (f_x, f_y, f_z), (m_x, m_y, m_z), (v_x, v_y, v_z) = force_frd_m_s2, self.mean_frd_m_s2, self.variance_m2_s4
        x, y, z = f_x - m_x, f_y - m_y, f_z - m_z
        self.mean_frd_m_s2 = (m_x + mean_share * x, m_y + mean_share * y, m_z + mean_share * z)
        self.load_factor += share * (load_factor - self.load_factor)
        grown = reflex.EXCESS * max(1.0, load_factor / self.load_factor)
        v_x, v_y, v_z = v_x + share * (x * x - v_x), v_y + share * (y * y - v_y), v_z + share * (z * z - v_z)
        self.variance_m2_s4 = (v_x, v_y, v_z)
        self.side_m_s2 = grown * math.sqrt(max(v_x, v_y, reflex.LEAST_SIDE_SHARE**2 * v_z))
        self.vertical_m_s2 = grown * math.sqrt(v_z)


@dataclass(slots=True)
class Lever:
    """Where the accelerometer is, from the point that the vehicle turns about. Changed only by its methods.

    With the rates p, q, r it is accelerated by h (-q' - p r, p' - q r) at a height h above that point, and by up to
    d (p^2 + q^2 + r^2) at a distance d beside it. The height is learnt, the distance is not.
    """

    below_m: float = 0.0
    height_error_m: float = reflex.LEVER_M  # standard deviation
    above_per_s2: tuple[float, float] = (0.0, 0.0)  # of each metre of height, body x and y; none across a gap
    error_m_s2: float = 0.0  # standard deviation of the sideways force of a sample, by that of the height
    unseen_m_s2: float = 0.0  # by what a turn between samples and a place beside the centre may make it more
    _rates_rad_s: Vector3 = ZERO
    _slope: Slope = field(default_factory=lambda: Slope(0.0, reflex.LEVER_M, -math.inf, math.inf))

    def at_centre(self, elapsed_us: int, f: Vector3, w: Vector3, averaging_us: int) -> Vector3:
        """Take force and rates (FRD) of a sample, the mean of `averaging_us`, `elapsed_us` after the one before it; the
        force at the point that the vehicle turns about."""
        (p, q, r), (a, b), self._rates_rad_s = self._rates_rad_s, self.above_per_s2, w
        if not 0 < elapsed_us < LONGEST_GAP_US:
            self.above_per_s2, self.error_m_s2, self.unseen_m_s2 = (0.0, 0.0), 0.0, 0.0
            return f
        per_s = 1e6 / elapsed_us
        # Rates of before: a hit has not changed them. What no motor makes is none: of one forged rate it is little.
        x, y = (q - w[1]) * per_s - p * r - a, (w[0] - p) * per_s - q * r - b
        changes = math.hypot(x, y)
        share = min(1.0, MOTORS_RAD_S2 / max(changes, 1.0))
        a, b = self.above_per_s2 = (a + share * x, b + share * y)
        # That may all have come while the accelerometer measured. Rates differ by what was half an interval ago, too.
        unseen = share * changes * max(0.5, 1.0 - averaging_us / elapsed_us)
        self.error_m_s2 = self.height_error_m * math.hypot(a, b)
        self.unseen_m_s2 = (abs(self.below_m) + self.height_error_m) * unseen + reflex.LEVER_M * (p * p + q * q + r * r)
        return (f[0] + self.below_m * a, f[1] + self.below_m * b, f[2])

    def learn(self, off_frd_m_s2: Vector3, variance: float) -> None:
        """Take by how much the newest sample of a free vehicle that turns, as of that point, is off the mean.

        `variance`: of that.
        """
        a, b = self.above_per_s2
        as_shown = (off_frd_m_s2[0] - self.below_m * a, off_frd_m_s2[1] - self.below_m * b, 0.0)
        self._slope.learn(as_shown, (a, b, 0.0))
        self.below_m, self.height_error_m = self._slope.found(variance)


@dataclass(slots=True)
class ThrustGain:
    """Specific force at full thrust, learnt as -f_z over the commanded thrust; the range that propellers can make.

    Changed only by its methods.
    """

    fraction: float = 0.0  # of the greatest thrust, as commanded
    fraction_until_us: int = -1  # until when it counts; not at all where it is too small for a quotient
    full_m_s2: float = 0.0
    known_s: float = 0.0
    most_m_s2: float = reflex.STRONGEST_M_S2  # largest upward specific force that thrust can explain

    def set_fraction(self, time_us: int, fraction: float) -> None:
        self.fraction = fraction
        self.fraction_until_us = time_us + CURRENT_US if fraction >= reflex.LEAST_FRACTION else -1

    def learn(self, time_us: int, thrust_m_s2: float, elapsed_s: float) -> None:
        """Take the specific force by thrust of one sample of a vehicle in free air.

        Propellers push nothing down: a vehicle whose specific force points down lies on its back.
        """
        if time_us <= self.fraction_until_us and thrust_m_s2 > 0.0 and elapsed_s > 0.0:
            self.known_s = min(self.known_s + elapsed_s, reflex.MEMORY_S)
            self.full_m_s2 += (thrust_m_s2 / self.fraction - self.full_m_s2) * elapsed_s / self.known_s
            if self.known_s >= reflex.MEMORY_S:
                self.most_m_s2 = reflex.MARGIN * self.full_m_s2

    def expected_m_s2(self, time_us: int, mean_m_s2: float) -> float:
        """Expected f_z in free air: from the commanded thrust, else its recent mean."""
        is_known = self.known_s >= reflex.MEMORY_S and time_us <= self.fraction_until_us
        return -self.full_m_s2 * self.fraction if is_known else mean_m_s2
