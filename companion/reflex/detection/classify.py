"""The kind of an impact: by what the vehicle did, then by what was asked of it. One table, read from above."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from companion.messages import Quaternion, Vector3
from companion.motion.config import GRAVITY_M_S2, SAME_M_S, SHOWN_US
from companion.motion.history import MotionHistory
from companion.motion.rotation import body_to_ned, tilt_rad
from companion.motion.vector import ZERO
from companion.reflex.config import GROUND_M, SCRAPING_M, STEEP
from companion.reflex.detection.detector import Impact, ImpactKind, Motion, Situation

# The speed of a fall from half of the height in which the ground may be: 3.1 m/s. PX4 lands at up to 1.5 m/s
# (MPC_Z_V_AUTO_DN) and ArduPilot, too (WPNAV_SPEED_DN).
FASTEST_LANDING_M_S = math.sqrt(GRAVITY_M_S2 * GROUND_M)


def hovers(velocity_ned_m_s: Vector3 | None) -> bool:
    """Whether the velocity is known, and too small to have run into anything: the obstacle came to the vehicle."""
    return velocity_ned_m_s is not None and math.hypot(*velocity_ned_m_s) < SAME_M_S


@dataclass(frozen=True, slots=True)
class Touch:
    """What is known of a contact when it is noticed. Local NED, SI.

    `sinking_m_s` is by the reported heights. The force's direction counts; its size has no influence.
    """

    force_ned: Vector3
    velocity_ned_m_s: Vector3 | None
    attitude_wxyz: Quaternion
    situation: Situation
    sinking_m_s: float | None = None

    @property
    def kind(self) -> ImpactKind:
        return next(kind for kind, _, applies in TABLE if applies(self))

    @property
    def upward(self) -> float:
        """Sine of the force's elevation."""
        size = math.hypot(*self.force_ned)
        return -self.force_ned[2] / size if size > 0.0 else 0.0

    @property
    def near_ground(self) -> bool:
        height_m = self.situation.height_m
        return height_m is None or height_m < GROUND_M

    @property
    def meets_ground(self) -> bool:
        """The place of arming may lie higher or lower than the ground here: what comes down, rather than sideways,
        meets it at any height.
        """
        north_m_s, east_m_s, down_m_s = self.velocity_ned_m_s or ZERO
        comes_down = down_m_s > math.hypot(north_m_s, east_m_s)
        is_let_down = self.situation.flown_by_hand and self.situation.descent_commanded
        return self.near_ground or (comes_down and (self.is_pushed_up or is_let_down))

    @property
    def is_pushed_up(self) -> bool:
        return self.upward > STEEP

    @property
    def may_land(self) -> bool:
        """Upright, and slow: what has not climbed since it stood on the ground cannot have fallen, whatever its climb
        rate says; and what falls loses height.
        """
        rates_m_s = [] if self.velocity_ned_m_s is None else [self.velocity_ned_m_s[2]]
        rates_m_s += [] if self.sinking_m_s is None else [self.sinking_m_s]
        is_fast = self.situation.has_climbed and min(rates_m_s, default=0.0) >= FASTEST_LANDING_M_S
        return math.cos(tilt_rad(self.attitude_wxyz)) > STEEP and not is_fast

    @property
    def has_landed(self) -> bool:
        """A vehicle on its way down meets the ground; one that is as low as its feet stands on it or scrapes along."""
        height_m = self.situation.height_m
        is_as_low_as_feet = height_m is not None and height_m < SCRAPING_M
        return is_as_low_as_feet or (self.situation.descent_commanded and (self.meets_ground or self.is_pushed_up))


# Each kind with its criterion, in words and as code. The first row that applies counts. A hand (`contact`) is told by
# how its force begins, before this table.
TABLE: Sequence[tuple[ImpactKind, str, Callable[[Touch], bool]]] = (
    (
        ImpactKind.CRASH,
        "near the ground, or coming down and pushed from below or flown down by hand; "
        "tilted by over 45 degrees, or sinking at over 3.1 m/s, by velocity and by height, after a climb",
        lambda touch: touch.meets_ground and not touch.may_land,
    ),
    (
        ImpactKind.LANDING,
        "sent down, near the ground or pushed from below; flown down by hand; as low as the feet",
        lambda touch: touch.has_landed,
    ),
    (
        ImpactKind.STRUCK,
        "hovering, away from the ground",
        lambda touch: hovers(touch.velocity_ned_m_s) and not touch.near_ground,
    ),
    (ImpactKind.FLOOR, "pushed from below", lambda touch: touch.is_pushed_up),
    (ImpactKind.CEILING, "pushed from above", lambda touch: touch.upward < -STEEP),
    (ImpactKind.WALL, "pushed from the side", lambda touch: True),
)


def classified(impact: Impact, velocity_ned_m_s: Vector3 | None, situation: Situation, motion: Motion) -> Impact:
    """The impact with its kind where that is unknown. `velocity_ned_m_s` is the newest."""
    if impact.kind is not ImpactKind.UNKNOWN:
        return impact
    attitude, free_us = motion.strapdown.valid_wxyz, impact.contact_free_until_boot_us
    # The newest velocity may contain a part of the contact already.
    before = next((fix for fix in reversed(motion.strapdown.fixes) if fix.time_boot_us <= free_us), None)
    velocity, until_us = velocity_ned_m_s, impact.sample_time_boot_us
    if before is not None:
        velocity, until_us = before.velocity_ned_m_s, before.time_boot_us
    force_ned = body_to_ned(attitude, impact.specific_force_frd_m_s2)
    touch = Touch(force_ned, velocity, attitude, situation, _sinking_m_s(motion.history, until_us))
    return replace(impact, kind=touch.kind)


def _sinking_m_s(history: MotionHistory, time_boot_us: int) -> float | None:
    """By the reported heights of SHOWN_US until a time; None without two of them.

    They give the mean of that time. A vehicle that falls is faster at its end, by half of what its reported velocity
    has gained.
    """
    last = history.before(time_boot_us + 1)
    first = None if last is None else history.before(last.time_boot_us - SHOWN_US)
    if last is None or first is None:
        return None
    mean_m_s = (last.position_ned_m[2] - first.position_ned_m[2]) * 1e6 / (last.time_boot_us - first.time_boot_us)
    return mean_m_s + 0.5 * (last.velocity_ned_m_s[2] - first.velocity_ned_m_s[2])
