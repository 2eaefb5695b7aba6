"""The interface of all collision detectors: samples and the flight's situation in, impact out, state explicit."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, NamedTuple, Protocol

from companion.messages import MessageId, Sample, Vector3
from companion.motion.history import MotionHistory
from companion.motion.strapdown import Strapdown
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.detection.free_flight import Lever, ThrustGain


class Phase(Enum):
    """What a detector is doing; the value is the word shown to people."""

    OFF = "off"  # not wanted now: `off_reason` says why
    QUIET = "quiet"  # switched on, waiting for a quiet interval before it trusts itself
    ARMED = "armed"  # the next sign of a hit fires
    CONTACT = "contact"  # has fired; the same contact cannot fire again


class ImpactKind(Enum):
    """What was touched, as far as telemetry can tell; the value is the word shown to people."""

    UNKNOWN = "hit"  # the detector does not classify
    WALL = "wall"
    CEILING = "ceiling"
    FLOOR = "floor"  # the ground, not by a landing
    STRUCK = "struck while hovering"  # the obstacle moved, not the vehicle
    LANDING = "landing"  # touchdown
    CRASH = "crash"  # the ground, tilted or faster than a landing may be
    CONTACT = "contact"  # held or pushed gently, as by a hand


# Why a detector is off that nobody switched off.
ON_THE_GROUND, NO_POSITION = "on the ground", "no position"


class Evidence(Enum):
    """By what an impact was found."""

    FORCE = "force"  # a sample's averaging window held the contact's own force
    VELOCITY_JUMP = "aftermath"  # the contact fell between the samples; what followed it showed
    RATE_JUMP = "turn"  # the vehicle turned at once, and turns on as fast; its force may follow
    SUSTAINED = "hold"  # no detector showed it: a force that lasted, or that tipped the vehicle


class Situation(NamedTuple):
    """What the flight knows when samples arrive; None where it does not. A tuple: one is made in every step."""

    off_reason: str | None = None  # why no hit may be reported now, but for a crash
    may_crash: bool = False  # it is known to fly, or did a moment ago, be it unwatched
    is_on_ground: bool = False  # as the vehicle says, unless it is known to be aloft
    height_m: float | None = None  # above the place of arming
    descent_commanded: bool = False  # or by the hand that flies it: touching the ground is no surprise
    setpoint_position_ned_m: Vector3 | None = None  # the place last sent, local NED, where one is flown to
    flown_by_hand: bool = False  # by a pilot's sticks
    has_climbed: bool = True  # higher than a take-off reaches, since it stood on the ground or touched it
    has_position: bool = True  # one came of late
    is_wreck: bool = False  # it has crashed and not flown since; that it bounces and is picked up is not told


@dataclass(slots=True)
class Motion:
    """What the samples add up to. All have heard the newest already. Samples behind a filter hide clipping."""

    history: MotionHistory = field(init=False, default_factory=MotionHistory)
    strapdown: Strapdown = field(init=False, default_factory=Strapdown)
    lever: Lever = field(init=False, default_factory=Lever)
    followed: list[MotionEstimator] = field(init=False, default_factory=list)
    """After the collision that is recovered from and the one before, and after the newest, if nobody answers that."""
    hides_clipping: bool = field(init=False, default=False)

    @property
    def after(self) -> MotionEstimator | None:
        """What is known after the newest collision; None once nothing of it is left."""
        return self.followed[-1] if self.followed else None

    @property
    def answered(self) -> list[MotionEstimator]:
        """Those of collisions with a recovery: if the newest was none, the one before counts."""
        return [each for each in self.followed if each.is_answered]

    @property
    def is_valid(self) -> bool:
        """Whether the vehicle's own velocity is: it lacks no part of a hit that was clipped."""
        return self.after is None or self.after.is_valid

    @property
    def left_m_s(self) -> float:
        """By how much it may be wrong; infinite where that is not known."""
        return 0.0 if self.after is None or self.after.is_valid else self.after.left_m_s


@dataclass(frozen=True, slots=True)
class Impact:
    """A hit, on the first sample that shows it."""

    sample_time_boot_us: int
    contact_free_until_boot_us: int
    """The latest time at which the vehicle was certainly still free: the start of the sample's averaging window, or the
    previous sample where the stream left a gap before it."""
    specific_force_frd_m_s2: Vector3
    """What the contact alone did to the vehicle, in body axes; where only the aftermath was seen, the mean over the gap
    that the contact must have fallen into."""
    kind: ImpactKind = ImpactKind.UNKNOWN
    evidence: Evidence = Evidence.FORCE
    is_shown_twice: bool = False  # by more than one message
    free_frd_m_s2: Vector3 | None = None  # what the accelerometer shows without a contact whose force may show yet

    @property
    def size_m_s2(self) -> float:
        """Of the contact's force per mass."""
        return math.hypot(*self.specific_force_frd_m_s2)

    @property
    def is_ground(self) -> bool:
        """The vehicle lies or stands on it now, or bounces."""
        return self.kind in (ImpactKind.LANDING, ImpactKind.CRASH)

    @property
    def is_collision(self) -> bool:
        """Touching the ground at the end of a landing and being caught by hand are nothing to recover from."""
        return self.kind not in (ImpactKind.LANDING, ImpactKind.CONTACT)


@dataclass(slots=True)
class Innovation:
    """What free flight does not explain, in the newest test of one sign, and the limit from which it is a hit.

    Of a force in m/s^2, of a velocity in m/s. EKF2 calls the square of their ratio a test ratio.
    """

    value: float = 0.0
    limit: float = math.inf


@dataclass(slots=True)
class DetectorState:
    """What every detector's state shows; a detector that remembers more extends it."""

    phase: Phase = Phase.OFF
    off_reason: str = "not started"
    last_sample_boot_us: int = 0
    last_loud_boot_us: int = 0  # of the present contact, or the latest one
    peak_specific_force_m_s2: float = 0.0  # of that contact, per unit mass, the largest in one sample so far
    threshold_m_s2: float = 0.0  # what a sample must reach now
    thrust: ThrustGain = field(default_factory=ThrustGain)  # learnt in free air
    turn: Innovation = field(default_factory=Innovation)  # a jump of the body rates


class Detector(Protocol):
    """A detector holds its parameters; all that changes is in the state that `step` is given.

    `losses` are the streams it makes use of besides HIGHRES_IMU, with what is lost where one does not arrive.
    """

    name: str
    losses: ClassVar[Mapping[MessageId, str]]

    def initial(self) -> DetectorState: ...

    def step(self, state: Any, sample: Sample, situation: Situation, motion: Motion) -> Impact | None:
        """Take one sample of any kind, in the order heard; IMU samples come in the order of their stamps."""
        ...
