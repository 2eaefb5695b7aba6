"""Where a vehicle is after a hit, and how it moves: by the accelerometer, put right by its estimate once that is right.

What clipping hides of a hit is missing in the vehicle's own velocity and then in its place: a real PX4 that bounced
back at 1.6 m/s said +2 m/s, into the wall, for 0.14 s, and was right again a second later (docs/px4.md). Until then
the motion is what the hit is expected to leave, and what the accelerometer has added since.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.estimate.approach import VelocityFix
from companion.estimate.rotation import body_to_ned
from companion.estimate.strapdown import GRAVITY_M_S2, Strapdown
from companion.messages import LocalPosition, Vector3
from companion.reflex.config import (
    BEGUN_US,
    CORRECTED_S,
    LEAD_S,
    LEAST_REBOUND,
    MOST_LEANT,
    OVER_US,
    SMOOTHED_S,
    STEADY_M_S,
    STEADY_US,
    STRUCK_M_S,
    UNCORRECTED_US,
    UPSET_M,
    UPSET_M_S,
    WIND_S,
)
from companion.reflex.halfspace import away_from, plus, split
from companion.reflex.laws import Contact
from companion.reflex.planner import REST, Moving


@dataclass(slots=True)
class Reckoning:
    """Local NED, SI, the vehicle's boot clock. Changed only by its methods."""

    contact: Contact
    hit_boot_us: int  # its first sample
    start: Moving  # after it, as expected
    inherits_doubt: bool = False  # from an earlier hit
    motion: Moving = field(init=False)
    is_whole: bool = False  # the accelerometer has shown all of the hit, and so the estimate knows it
    is_right: bool = False  # the estimate has been found so
    lean_m_s2: Vector3 = REST  # the level acceleration that the thrust is about to give
    wind_m_s2: tuple[float, float] = (0.0, 0.0)  # what the lean does in vain, north and east
    _time_boot_us: int = 0
    _corrected_boot_us: int = 0

    def __post_init__(self) -> None:
        self.motion = self.start

    def tell(self, is_whole: bool) -> None:
        """Whether the accelerometer has shown all of the hit, as far as is known by now."""
        self.is_whole = is_whole and not self.inherits_doubt

    def imu(self, strapdown: Strapdown) -> None:
        """Take the newest sample. More than gravity is a contact's push, of which the start says what it leaves."""
        time_us, elapsed_s = strapdown.time_boot_us, 1e-6 * (strapdown.time_boot_us - self._time_boot_us)
        first, self._time_boot_us = self._time_boot_us == 0, time_us
        if first or not 0.0 < elapsed_s < 0.1:
            return
        pushed = strapdown.acceleration_ned_m_s2
        if math.hypot(*pushed) >= GRAVITY_M_S2:
            pushed = REST
        was, weight = self.motion, elapsed_s / (SMOOTHED_S + elapsed_s)
        mean = plus(was.acceleration_ned_m_s2, weight, plus(pushed, -1.0, was.acceleration_ned_m_s2))
        place = plus(was.position_ned_m, elapsed_s, plus(was.velocity_ned_m_s, 0.5 * elapsed_s, pushed))
        self.motion = Moving(place, plus(was.velocity_ned_m_s, elapsed_s, pushed), mean)
        self.lean_m_s2 = lean_ahead(strapdown)
        if pushed is not REST:
            (a, b), (n, e, _), share = self.wind_m_s2, self.lean_m_s2, elapsed_s / (WIND_S + elapsed_s)
            self.wind_m_s2 = (a + share * (n - pushed[0] - a), b + share * (e - pushed[1] - b))

    def correct(self, sample: LocalPosition) -> None:
        """By an estimate that is right: at once by the first, then by so much as is not its noise."""
        elapsed_s = 1e-6 * (sample.time_boot_us - self._corrected_boot_us)
        share = elapsed_s / (CORRECTED_S + elapsed_s) if self._corrected_boot_us else 1.0
        was, self._corrected_boot_us = self.motion, sample.time_boot_us
        place = plus(was.position_ned_m, share, plus(sample.position_ned_m, -1.0, was.position_ned_m))
        velocity = plus(was.velocity_ned_m_s, share, plus(sample.velocity_ned_m_s, -1.0, was.velocity_ned_m_s))
        self.motion = Moving(place, velocity, was.acceleration_ned_m_s2)

    def judge(
        self, sample: LocalPosition, normals: Sequence[Vector3], fixes: Sequence[VelocityFix], impulse_m_s: float
    ) -> bool:
        """Whether the estimate may be believed: it knows the hit, shows a rebound or goes along with the sensor.

        What no hit explains is not believed before its swing is over.
        """
        since_us = sample.time_boot_us - self.hit_boot_us
        changed = away_from(plus(sample.velocity_ned_m_s, -1.0, self.contact.velocity_ned_m_s))
        shows = since_us < UNCORRECTED_US and any(self._rebounds(sample, normal) for normal in (*normals, changed))
        shows = shows or self.is_whole or (since_us >= BEGUN_US and is_steady(fixes, sample.time_boot_us))
        self.is_right = self.is_right or since_us >= OVER_US or (shows and self._explains(sample, impulse_m_s))
        return self.is_right

    def _rebounds(self, sample: LocalPosition, normal_ned: Vector3) -> bool:
        before = self.contact.velocity_ned_m_s
        into_m_s, off_m_s = (split(v, normal_ned)[0] for v in (before, sample.velocity_ned_m_s))
        least_m_s = max(LEAST_REBOUND * math.hypot(*before), STRUCK_M_S)
        return off_m_s >= -LEAST_REBOUND * min(0.0, into_m_s) and off_m_s - into_m_s >= least_m_s

    def _explains(self, sample: LocalPosition, impulse_m_s: float) -> bool:
        """A contact changes the velocity by its impulse, of which a clipped sensor shows a part, and where the obstacle
        stands still by no more than twice the speed of the approach."""
        before, since_s = self.contact, 1e-6 * (sample.time_boot_us - self.hit_boot_us)
        speed_m_s = math.hypot(*before.velocity_ned_m_s)
        most_m_s = max(2.0 * speed_m_s, impulse_m_s) + UPSET_M_S
        most_m = (speed_m_s + most_m_s) * since_s + UPSET_M
        is_upset = math.dist(sample.velocity_ned_m_s, before.velocity_ned_m_s) > most_m_s
        return not is_upset and math.dist(sample.position_ned_m, before.position_ned_m) <= most_m


def lean_ahead(strapdown: Strapdown) -> Vector3:
    """The level acceleration of a thrust that carries the vehicle, leant as once what is asked now acts."""
    n, e, d = body_to_ned(strapdown.attitude_wxyz, (0.0, 0.0, -1.0))
    p, q, r = body_to_ned(strapdown.attitude_wxyz, strapdown.rates_frd_rad_s)
    n, e, d = n + LEAD_S * (q * d - r * e), e + LEAD_S * (r * n - p * d), d + LEAD_S * (p * e - q * n)
    carrying_m_s2 = GRAVITY_M_S2 / max(-d, MOST_LEANT)
    return (carrying_m_s2 * n, carrying_m_s2 * e, 0.0)


def is_steady(fixes: Sequence[VelocityFix], boot_us: int) -> bool:
    """Whether the estimated velocity has changed of late by what the accelerometer shows."""
    recent = [fix for fix in fixes if boot_us - fix.time_boot_us <= STEADY_US]
    missing = [plus(fix.velocity_ned_m_s, -1.0, fix.sum_ned_m_s) for fix in recent]
    return len(recent) > 2 and all(max(axis) - min(axis) <= STEADY_M_S for axis in zip(*missing, strict=True))


def half_way(pushed_ned: Vector3, velocity_ned_m_s: Vector3) -> Vector3:
    """Away from an obstacle of which only a clipped push is known, each axis clipped alone; unit vectors.

    Back is where the vehicle came from, and free: half way between the two, or back where they are 60 degrees apart.
    """
    n, e, _ = velocity_ned_m_s
    back = away_from((-n, -e, 0.0)) if math.hypot(n, e) >= LEAST_REBOUND else REST
    if back == REST:
        return pushed_ned
    together = split(pushed_ned, back)[0]
    return back if together < 0.5 else away_from(plus(pushed_ned, 1.0, back))
