"""The velocity that a satellite receiver measures by Doppler shift, and its place, carried on to now.

No accelerometer has a part in it: after a clipped hit it shows what the vehicle's own estimate lacks. What is received
now was measured earlier. Delay and noise are learnt in free flight. With the vehicle's own velocity v, its acceleration
a by the accelerometer and the delay d

    u(t) = v(t - d) + noise,    u(t) - v(t) = -d a + noise

How far its place is from the vehicle's own is learnt in free flight, too.
"""

import math
from dataclasses import dataclass, field

from companion.messages import GpsFix, LocalPosition, Vector3
from companion.motion import config as numbers
from companion.motion.slope import Slope
from companion.motion.strapdown import Strapdown, VelocityFix
from companion.motion.vector import ZERO, flat, limited, minus, plus, towards


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
            off = minus(plus(own.position_ned_m, since_s, own.velocity_ned_m_s), place)
            self._off_m = off if self._off_m is None else towards(self._off_m, off, 1.0 / self.known)
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


@dataclass(slots=True)
class MeasuredVelocity:
    """Kalman filter of the horizontal velocity v and of the acceleration b that the accelerometer does not show, as its
    attitude is wrong: v' = a + b. A velocity that was carried on by the accelerometer over its delay d is v - d b.
    Changed only by its methods; local NED, SI, the vehicle's boot clock.
    """

    time_boot_us: int
    summed_m_s: Vector3  # the accelerometer's integral up to its time
    velocity_ned_m_s: Vector3
    variance_m2_s2: float  # of v on an axis
    taken_boot_us: int  # the newest of its velocities was measured later than this
    unseen_m_s2: Vector3 = ZERO
    both_m2_s3: float = 0.0  # covariance of v and b
    unseen_variance_m2_s4: float = numbers.LEVEL_SPREAD_M_S2**2

    def predict(self, time_boot_us: int, summed_m_s: Vector3) -> None:
        """Up to a time, with the accelerometer's integral until then."""
        elapsed_s = 1e-6 * (time_boot_us - self.time_boot_us)
        faster = plus(minus(summed_m_s, self.summed_m_s), elapsed_s, self.unseen_m_s2)
        self.velocity_ned_m_s = plus(self.velocity_ned_m_s, 1.0, faster)
        self.variance_m2_s2 += elapsed_s * (
            2.0 * self.both_m2_s3 + elapsed_s * self.unseen_variance_m2_s4 + numbers.DRIFT_M2_S3
        )
        self.both_m2_s3 += elapsed_s * self.unseen_variance_m2_s4
        self.unseen_variance_m2_s4 += numbers.LEVEL_DRIFT_M2_S5 * elapsed_s
        self.time_boot_us, self.summed_m_s = time_boot_us, summed_m_s

    def update(self, doppler: Doppler, was_odd: bool) -> bool:
        """Take a receiver's velocity; whether it is beyond belief, and left out unless the last one was, too."""
        late_s = doppler.late_s
        innovation = flat(plus(minus(doppler.velocity_ned_m_s, self.velocity_ned_m_s), late_s, self.unseen_m_s2))
        with_v = self.variance_m2_s2 - late_s * self.both_m2_s3
        with_b = self.both_m2_s3 - late_s * self.unseen_variance_m2_s4
        # No receiver is better than the best.
        variance = with_v - late_s * with_b + max(doppler.variance_m2_s2, numbers.FINEST_DOPPLER_M_S**2)
        is_odd = math.hypot(*innovation) / math.sqrt(variance) > numbers.GATE
        if was_odd or not is_odd:
            self.velocity_ned_m_s = plus(self.velocity_ned_m_s, with_v / variance, innovation)
            self.unseen_m_s2 = plus(self.unseen_m_s2, with_b / variance, innovation)
            self.variance_m2_s2 -= with_v * with_v / variance
            self.both_m2_s3 -= with_v * with_b / variance
            self.unseen_variance_m2_s4 -= with_b * with_b / variance
            self.taken_boot_us = doppler.taken_boot_us
        return is_odd


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
