"""What free flight teaches: the noise of the specific force on each axis, where the accelerometer is, and the specific
force of full thrust."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from companion.messages import Vector3
from companion.motion.config import CURRENT_US, LONGEST_GAP_US, MOTORS_RAD_S2
from companion.motion.vector import ZERO
from companion.reflex import config as reflex

Floats = npt.NDArray[np.float64]


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
    """Where the accelerometer is, from the point that the vehicle turns about. Changed only by its methods; body FRD.

    With the rates w it shows w' x r + w x (w x r) more at a place r beside that point. Of f_x and f_y, in which thrust
    has no part, that is H r. r is the least-squares estimate over the turns of the flight, with a prior about zero.
    """

    place_frd_m: Vector3 = ZERO
    errors_m: Vector3 = (reflex.LEVER_M, reflex.LEVER_M, reflex.LEVER_M)  # standard deviations
    force_frd_m_s2: Vector3 = ZERO  # of the newest sample, sideways as at that point
    unseen_m_s2: float = 0.0  # by what a turn between samples and a place beside the centre may make it more
    spins_per_s2: float = 0.0  # square of the rates
    _before_rad_s: Vector3 = ZERO  # rates of the sample before the newest
    _rates_rad_s: Vector3 = ZERO
    _turns_rad_s2: Vector3 = ZERO  # as between these; no more than motors make
    _shown_m_s2: Vector3 = ZERO  # by the newest sample
    _samples: list[tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=list)
    """H, and what is shown of f_x and f_y, of those to be learnt from; they are, every RATE_MEMORY_US."""
    _since_s: float = 0.0
    _yawed_rad: float = 0.0  # since the mean was turned last
    _mean: Floats = field(default_factory=lambda: np.zeros((2, 4)))  # of H, and of what is shown of f_x and f_y
    _square: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    _against: Floats = field(default_factory=lambda: np.zeros(3))

    def imu(self, elapsed_us: int, f: Vector3, w: Vector3, averaging_us: float) -> None:
        """Take force and rates of a sample, the mean of `averaging_us`, `elapsed_us` after the one before it."""
        # Rates of before: a hit has not changed them.
        p, q, r = self._before_rad_s = self._rates_rad_s
        i, j, _ = self._turns_rad_s2
        self._rates_rad_s, self.force_frd_m_s2, self._shown_m_s2 = w, f, f
        if not 0 < elapsed_us < LONGEST_GAP_US:
            self._turns_rad_s2, self.unseen_m_s2, self.spins_per_s2 = ZERO, 0.0, 0.0
            return
        per_s = 1e6 / elapsed_us
        # What no motor makes is none: of one forged rate it is little.
        x, y, k = (w[0] - p) * per_s - i, (w[1] - q) * per_s - j, (w[2] - r) * per_s
        changes = math.hypot(x, y)
        if changes > MOTORS_RAD_S2:
            x, y, changes = x * MOTORS_RAD_S2 / changes, y * MOTORS_RAD_S2 / changes, MOTORS_RAD_S2
        if abs(k) > MOTORS_RAD_S2:
            k = math.copysign(MOTORS_RAD_S2, k)
        self._turns_rad_s2 = i, j, k = i + x, j + y, k
        square = self.spins_per_s2 = p * p + q * q + r * r
        # That may all have come while the accelerometer measured. Rates differ by what was half an interval ago, too.
        unseen_share = 1.0 - averaging_us / elapsed_us
        (x, y, z), (x_error, y_error, z_error) = self.place_frd_m, self.errors_m
        self.unseen_m_s2 = (abs(z) + z_error) * changes * (unseen_share if unseen_share > 0.5 else 0.5)
        self.unseen_m_s2 += (x_error if x_error > y_error else y_error) * square
        n = p * x + q * y + r * z
        self.force_frd_m_s2 = (
            f[0] - j * z + k * y - p * n + square * x,
            f[1] - k * x + i * z - q * n + square * y,
            f[2],
        )

    @property
    def error_frd_m_s2(self) -> tuple[float, float]:
        """Standard deviation of the force's sideways part, along what a turn makes of it, by that of the height."""
        (p, q, r), (i, j, _), z_error = self._before_rad_s, self._turns_rad_s2, self.errors_m[2]
        return z_error * (p * r + j), z_error * (q * r - i)

    def learn(self, variance: float, elapsed_s: float) -> None:
        """Take the newest sample of a free vehicle that turns beyond the gyroscopes' noise.

        `variance`: of its force besides. It teaches with a later one: what comes just before a hit may be of it.
        """
        if 1e6 * self._since_s >= reflex.RATE_MEMORY_US:
            self._teach(variance)
        (p, q, r), (i, j, k), (x, y, _) = self._before_rad_s, self._turns_rad_s2, self._shown_m_s2
        rows = (-q * q - r * r, p * q - k, p * r + j, x), (p * q + k, -p * p - r * r, q * r - i, y)
        self._samples.append(rows)
        self._since_s += elapsed_s
        self._yawed_rad += elapsed_s * r

    def forget(self) -> None:
        """What has not taught yet never does."""
        self._samples, self._since_s = [], 0.0

    def _teach(self, variance: float) -> None:
        # Their mean: the gyroscopes' noise in H would make the place nearer.
        count, shown = len(self._samples), np.mean(self._samples, axis=0)
        c, s = math.cos(self._yawed_rad), math.sin(self._yawed_rad)
        share, self._samples, self._since_s = min(self._since_s / reflex.LEAD_S, 1.0), [], 0.0
        # Less what lasts beside a turn: drag and gusts change no faster than the attitude, and turn against the yaw.
        self._mean, self._yawed_rad = [[c, s], [-s, c]] @ self._mean, 0.0
        self._mean += share * (shown - self._mean)
        h, force = np.hsplit(shown - self._mean, [3])
        self._square += count / variance * h.T @ h
        self._against += count / variance * h.T @ force[:, 0]
        known = np.linalg.inv(self._square + reflex.LEVER_M**-2 * np.eye(3))
        x, y, z = (known @ self._against).tolist()
        self.place_frd_m = (x, y, z)
        x, y, z = np.sqrt(known.diagonal()).tolist()
        self.errors_m = (x, y, z)


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
        self.fraction_until_us = time_us + CURRENT_US if fraction >= reflex.LEAST_THRUST else -1

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
