"""Detectors of the accelerometer alone: `threshold`, `fuzzy` and `lateral`."""

import math
from dataclasses import dataclass

from bench.detectors.contact import Baseline, BaselineState, Reading
from companion.messages import ImuSample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO
from companion.reflex.detection.detector import Phase, Situation

# Samples, as in its authors' program.
WINDOW = 10
# A vehicle that shakes more gets a higher threshold: this many times the spread it shows in its own flight.
# Of samples with a normal spread not one in 10^8 is beyond six; four public PX4 logs of healthy flights, with
# spreads of 1.2 to 4 m/s^2, stay below five but for one sample.
NOISE_FACTOR = 6.0
# The noise floor's memory. Long enough for 25 samples at 50 Hz (a spread good to 15 %), short enough to have forgotten
# the ground by the top of a take-off and to follow drag as the speed changes.
MEMORY_US = 500_000


@dataclass(slots=True)
class ThresholdState(BaselineState):
    """Adds the window: samples since its start, and of its loudest sample the axis and the force (FRD, no gravity)."""

    since: int | None = None
    is_open: bool = False
    opened_after_us: int = 0
    largest_m_s2: float = 0.0
    force_m_s2: Vector3 = ZERO


class ThresholdDetector(Baseline):
    """Detector `threshold`: a fixed threshold on each axis, told when a window of samples is over; here as the
    baseline.

    Source: R. Wang et al., "Air Bumper: A Collision Detection and Reaction Framework for Autonomous MAV Navigation"
    (arXiv 2307.06101, ICRA 2024), held against the authors' program, github.com/ryrobotics/air_bumper, file
    src/imu_detection.cpp. With gravity taken off the body's z axis (there 9.8 m/s^2), a sample is loud when one axis of
    it exceeds 20 m/s^2. The first loud sample opens a window, in which the sample with the largest axis is kept. The
    push kept is told by the first sample more than ten after the window's start; a sample that is loud just then opens
    the next window instead, so that a push that lasts is told when it is over.

    Not theirs: one contact is told once (`contact`), and reports while the detector is off are dropped.
    """

    name, state = "threshold", ThresholdState

    def look(self, s: ThresholdState, sample: ImuSample, situation: Situation) -> Reading:
        f_x, f_y, f_z = sample.specific_force_frd_m_s2
        self._count(s, sample.time_boot_us, (f_x, f_y, f_z + GRAVITY_M_S2))
        is_told = s.is_open and s.since is not None and s.since > WINDOW
        if is_told:
            s.is_open = False
        return Reading(is_told, s.force_m_s2, s.largest_m_s2, s.opened_after_us)

    def _count(self, s: ThresholdState, now_us: int, force: Vector3) -> None:
        """Count the sample; open the window with it, or keep it if it is the loudest."""
        size = max(abs(force[0]), abs(force[1]), abs(force[2]))
        if s.since is not None:
            s.since += 1
        if size <= s.threshold_m_s2:
            return
        if s.since is None or s.since > WINDOW:
            if not s.is_open:
                s.opened_after_us = self.free_until_us(s, now_us)
            s.since, s.largest_m_s2 = 0, 0.0
        if size > s.largest_m_s2 and s.since < WINDOW:
            s.is_open, s.largest_m_s2, s.force_m_s2 = True, size, force


class FuzzyDetector(Baseline):
    """Detector `fuzzy`: a horizontal acceleration of more than 1 g.

    After F. Chui, G. Dicker and I. Sharf, "Dynamics of a quadrotor undergoing impact with a wall" (ICUAS 2016) and G.
    Dicker, I. Sharf and P. Rustagi, "Recovery control for quadrotor UAV colliding with a pole" (IROS 2018), held
    against the authors' program for PX4, github.com/fionachui/PX4-Firmware_Recovery, src/modules/impact_detection.

    A collision is an accelerometer reading whose horizontal part, in the world, exceeds 9.81 m/s^2; the next one counts
    when it has been below that again. The fuzzy process that gives the method its name rates a collision that is found:
    how hard their reaction accelerates away from the wall. It finds none, and is left out: the recovery laws here
    answer to v_c and the normal, which are measured.

    Not theirs: one contact is told once (`contact`); the detector is off when the flight says so. The articles
    themselves were not at hand.
    """

    name = "fuzzy"

    def look(self, s: BaselineState, sample: ImuSample, situation: Situation) -> Reading:
        f = sample.specific_force_frd_m_s2
        north, east, _ = body_to_ned(s.attitude_wxyz, f)
        size = math.hypot(north, east)
        return Reading(size > s.threshold_m_s2, (f[0], f[1], 0.0), size, self.free_until_us(s, sample.time_boot_us))


@dataclass(slots=True)
class LateralState(BaselineState):
    """Adds what the vehicle shakes: exponentially weighted mean (m/s^2) and variance of f_x and f_y, body FRD."""

    mean_x_m_s2: float = 0.0
    mean_y_m_s2: float = 0.0
    variance_x: float = 0.0
    variance_y: float = 0.0
    known_for_us: int = 0

    @property
    def spread_m_s2(self) -> float:
        """Standard deviation on the noisier axis."""
        return math.sqrt(max(self.variance_x, self.variance_y))

    def learn(self, f_x_m_s2: float, f_y_m_s2: float, elapsed_us: int) -> None:
        """One more sample, so long after the last; the first ones count as a plain mean."""
        self.known_for_us = min(self.known_for_us + elapsed_us, MEMORY_US)
        share = min(1.0, elapsed_us / self.known_for_us) if self.known_for_us > 0 else 1.0
        x, y = f_x_m_s2 - self.mean_x_m_s2, f_y_m_s2 - self.mean_y_m_s2
        keep = 1.0 - share
        self.mean_x_m_s2 += share * x
        self.mean_y_m_s2 += share * y
        self.variance_x = keep * (self.variance_x + share * x * x)
        self.variance_y = keep * (self.variance_y + share * y * y)


class LateralDetector(Baseline):
    """Detector `lateral`: specific force that the thrust cannot explain, because it is perpendicular to it.

    By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z, and on x and y only drag and noise.
    A wall pushes sideways. The first sample whose sideways force departs from its running mean (the drag) by the
    threshold or more is a hit.

    Not of an article: this project's own, so that the paper's studies have a detector on the accelerometer alone.
    Checked against nobody's program.
    """

    name, state = "lateral", LateralState

    def look(self, s: LateralState, sample: ImuSample, situation: Situation) -> Reading:
        now_us, (f_x, f_y, _) = sample.time_boot_us, sample.specific_force_frd_m_s2
        x, y = f_x - s.mean_x_m_s2, f_y - s.mean_y_m_s2
        # A gap says nothing about what was in it: a sample after one weighs as one sample.
        elapsed_us = min(max(now_us - s.last_sample_boot_us, 0), MEMORY_US // 10)
        size = math.hypot(x, y)
        is_loud = size >= s.threshold_m_s2
        # Also while it is off, for the spread must be known when it is switched on, and in a shake in which it was: a
        # threshold that is too low would never rise.
        if not is_loud or situation.off_reason is not None or s.phase not in (Phase.ARMED, Phase.CONTACT):
            s.learn(f_x, f_y, elapsed_us)
            s.threshold_m_s2 = max(self._least_m_s2, NOISE_FACTOR * s.spread_m_s2)
        return Reading(is_loud, (x, y, 0.0), size, self.free_until_us(s, now_us))
