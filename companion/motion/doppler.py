"""The velocity that a satellite receiver measures by Doppler shift, and its place, carried on to now.

No accelerometer has a part in it: after a clipped hit it shows what the vehicle's own estimate lacks. What is received
now was measured earlier. Delay and noise are learnt in free flight. With the vehicle's own velocity v, its acceleration
a by the accelerometer and the delay d

    u(t) = v(t - d) + noise,    u(t) - v(t) = -d a + noise

How far its place is from the vehicle's own is learnt in free flight, too.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from companion.messages import GpsFix, LocalPosition, Vector3
from companion.motion import config as numbers
from companion.motion.slope import Slope
from companion.motion.strapdown import Strapdown, VelocityFix
from companion.motion.vector import ZERO, flat, limited, minus, plus, towards

Floats = npt.NDArray[np.float64]


@dataclass(slots=True)
class Doppler:
    """Changed only by its methods. Local NED, SI, the vehicle's boot clock; nothing is measured of the climb."""

    taken_boot_us: int = -1  # the newest velocity was measured later than this
    velocity_ned_m_s: Vector3 = ZERO  # as of the newest IMU sample; horizontal
    late_s: float = 0.0  # carried on by so much
    variance_m2_s2: float = numbers.DOPPLER_M_S**2
    known: int = 1
    delay: Slope = field(
        default_factory=lambda: Slope(
            numbers.RECEIVER_DELAY_S,
            numbers.RECEIVER_SPREAD_S,
            0.0,
            numbers.RECEIVER_LATEST_S,
            numbers.RECEIVER_REPEATS,
        )
    )
    place_ned_m: Vector3 | None = None  # horizontal, as of then; None until it is known beside the vehicle's own
    place_variance_m2: float = numbers.RECEIVER_PLACE_M**2
    _first: GpsFix | None = None  # where its places are counted from
    _off_m: Vector3 | None = None  # the vehicle's own place less the receiver's

    def take(self, sample: GpsFix, strapdown: Strapdown, own: LocalPosition | None, is_free: bool) -> None:
        """Take one fix; `is_free`: the vehicle's own newest report is right. What cannot be carried on to now is left
        out."""
        if is_free:
            self._learn(sample, strapdown)
        self.late_s, error_s = self.delay.found(self.variance_m2_s2)
        faster = _faster_by(strapdown, self.late_s)
        if faster is None:
            return
        n, e = sample.velocity_ne_m_s
        self.taken_boot_us = strapdown.time_boot_us - round(1e6 * (self.late_s + numbers.CERTAIN * error_s))
        self.velocity_ned_m_s = (n + faster[0], e + faster[1], 0.0)
        place = plus(self._counted_m(sample), 0.5 * self.late_s, plus((n, e, 0.0), 1.0, self.velocity_ned_m_s))
        if is_free and own is not None:
            since_s = 1e-6 * (strapdown.time_boot_us - own.time_boot_us)
            off = flat(minus(plus(own.position_ned_m, since_s, own.velocity_ned_m_s), place))
            mean = self._off_m = off if self._off_m is None else towards(self._off_m, off, 1.0 / self.known)
            self.place_variance_m2 += (0.5 * math.dist(off, mean) ** 2 - self.place_variance_m2) / self.known
        self.place_ned_m = None if self._off_m is None else plus(place, 1.0, self._off_m)

    def _counted_m(self, sample: GpsFix) -> Vector3:
        """North and east of the first fix."""
        first = self._first = self._first or sample
        north_rad = math.radians(sample.latitude_deg - first.latitude_deg)
        east_rad = math.remainder(math.radians(sample.longitude_deg - first.longitude_deg), math.tau)
        return (
            numbers.EARTH_M * north_rad,
            numbers.EARTH_M * east_rad * math.cos(math.radians(first.latitude_deg)),
            0.0,
        )

    def _learn(self, sample: GpsFix, strapdown: Strapdown) -> None:
        usual_s = self.delay.expected
        faster = _faster_by(strapdown, usual_s)
        if faster is None:
            return
        (n, e), own = sample.velocity_ne_m_s, plus(strapdown.fixes[-1].less_sum_m_s, 1.0, _at_centre(strapdown))
        behind: Vector3 = (n - own[0], e - own[1], 0.0)
        change = plus(ZERO, 1.0 / usual_s, faster)
        most_m_s = numbers.GATE * math.sqrt(self.variance_m2_s2)
        # A receiver may show a hit before any sample does: neither its noise nor its delay.
        if math.hypot(*plus(behind, self.delay.found(self.variance_m2_s2)[0], change)) < most_m_s:
            self.delay.learn(behind, change)
        noise = limited(plus(behind, self.delay.found(self.variance_m2_s2)[0], change), most_m_s)
        self.known = min(self.known + 1, numbers.MEMORY_STEPS)
        self.variance_m2_s2 += (0.5 * math.hypot(*noise) ** 2 - self.variance_m2_s2) / self.known


class MeasuredMotion:
    """Kalman filter of the horizontal place x, the velocity v and the acceleration b that the accelerometer does not
    show, as its attitude is wrong: x' = v, v' = a + b. A velocity that was carried on by the accelerometer over its
    delay d is v - d b.

    The state (3, 2) is x, v, b north and east; its covariance (3, 3) is that of either. Changed only by its methods;
    local NED, SI, the vehicle's boot clock. `taken_boot_us`: the newest of its velocities was measured later than this.
    """

    def __init__(
        self, time_boot_us: int, place_ned_m: Vector3, velocity_ned_m_s: Vector3, spreads: tuple[float, float]
    ) -> None:
        """`spreads`: standard deviations of place and velocity then."""
        self.time_boot_us = self.taken_boot_us = time_boot_us
        self._summed_m_s, self.state = ZERO, np.array([place_ned_m[:2], velocity_ned_m_s[:2], (0.0, 0.0)])
        self.covariance = np.diag(np.square([*spreads, numbers.LEVEL_SPREAD_M_S2]))

    def predict(self, time_boot_us: int, summed_m_s: Vector3) -> None:
        """Up to a time, with the accelerometer's integral from the beginning until then."""
        elapsed_s, added = 1e-6 * (time_boot_us - self.time_boot_us), minus(summed_m_s, self._summed_m_s)
        leads = np.array([[1.0, elapsed_s, 0.5 * elapsed_s**2], [0.0, 1.0, elapsed_s], [0.0, 0.0, 1.0]])
        self.state = leads @ self.state + np.outer((0.5 * elapsed_s, 1.0, 0.0), added[:2])
        spread = elapsed_s * np.diag((0.0, numbers.DRIFT_M2_S3, numbers.LEVEL_DRIFT_M2_S5))
        self.covariance = leads @ self.covariance @ leads.T + spread
        self.time_boot_us, self._summed_m_s = time_boot_us, summed_m_s

    def update(self, doppler: Doppler, was_odd: bool) -> bool:
        """Take a receiver's velocity and place; whether the velocity is beyond belief, and both are left out unless the
        last one was, too."""
        # No receiver is better than the best.
        noise_m2_s2 = max(doppler.variance_m2_s2, numbers.FINEST_DOPPLER_M_S**2)
        row = np.array((0.0, 1.0, -doppler.late_s))
        innovation, variance = self._innovation(row, doppler.velocity_ned_m_s, noise_m2_s2)
        is_odd = math.hypot(*innovation) > numbers.GATE * math.sqrt(variance)
        if was_odd or not is_odd:
            self._correct(row, innovation, variance)
            if doppler.place_ned_m is not None:
                row = np.array((1.0, 0.0, 0.0))
                noise_m2 = numbers.RECEIVER_REPEATS * doppler.place_variance_m2
                off_m, variance = self._innovation(row, doppler.place_ned_m, noise_m2)
                self._correct(row, limited(off_m, numbers.GATE * math.sqrt(variance)), variance)
            self.taken_boot_us = doppler.taken_boot_us
        return is_odd

    def _innovation(self, row: Floats, measured: Vector3, noise: float) -> tuple[Vector3, float]:
        """The innovation of a measured sum of the state, and its variance."""
        n, e = (measured[:2] - row @ self.state).tolist()
        return (n, e, 0.0), float(row @ self.covariance @ row) + noise

    def _correct(self, row: Floats, innovation: Vector3, variance: float) -> None:
        gain = self.covariance @ row / variance
        self.state = self.state + np.outer(gain, innovation[:2])
        self.covariance = self.covariance - variance * np.outer(gain, gain)

    @property
    def unseen_m_s2(self) -> Vector3:
        """b."""
        n, e = self.state[2].tolist()
        return (n, e, 0.0)


def _faster_by(strapdown: Strapdown, since_s: float) -> Vector3 | None:
    """What the accelerometer has added to the horizontal velocity in so long; None where that is not kept."""
    now_us, sum_m_s = strapdown.time_boot_us, _at_centre(strapdown)
    at_us, later_us, later_m_s = now_us - round(1e6 * since_s), now_us, sum_m_s
    for fix in reversed(strapdown.fixes):
        if fix.time_boot_us <= at_us:
            share = (at_us - fix.time_boot_us) / max(later_us - fix.time_boot_us, 1)
            then_m_s = towards(_at_centre(fix), later_m_s, share)
            return flat(minus(sum_m_s, then_m_s))
        later_us, later_m_s = fix.time_boot_us, _at_centre(fix)
    return None


def _at_centre(of: Strapdown | VelocityFix) -> Vector3:
    """The accelerometer's integral as it were at the vehicle's centre, of which a receiver measures the velocity."""
    return minus(of.sum_ned_m_s, of.turns_ned_m_s)
