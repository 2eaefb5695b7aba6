"""Detector `threshold`: a fixed threshold on each axis, told when a window of samples is over; here as the baseline.

Source: R. Wang et al., "Air Bumper: A Collision Detection and Reaction Framework for Autonomous MAV Navigation"
(arXiv 2307.06101, ICRA 2024), held against the authors' program, github.com/ryrobotics/air_bumper, file
src/imu_detection.cpp. With gravity taken off the body's z axis (there 9.8 m/s^2), a sample is loud when one axis of it
exceeds 20 m/s^2. The first loud sample opens a window, in which the sample with the largest axis is kept. The push
kept is told by the first sample more than ten after the window's start; a sample that is loud just then opens the
next window instead, so that a push that lasts is told when it is over.

Not theirs: one contact is told once (`contact`), and reports while the detector is off are dropped.
"""

from dataclasses import dataclass

from bench.detectors.contact import Baseline, judge
from companion.messages import ImuSample, Sample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.strapdown import ZERO
from companion.reflex.detector import DetectorState, Impact, Situation

# Samples, as in its authors' program.
WINDOW = 10


@dataclass(slots=True)
class ThresholdState(DetectorState):
    """Adds the window: samples since its start, and of its loudest sample the axis and the force (FRD, no gravity)."""

    since: int | None = None
    is_open: bool = False
    free_until_us: int = 0
    largest_m_s2: float = 0.0
    force_m_s2: Vector3 = ZERO


class ThresholdDetector(Baseline):
    """See the module's text."""

    name, state = "threshold", ThresholdState

    def step(self, state: ThresholdState, sample: Sample, situation: Situation) -> tuple[ThresholdState, Impact | None]:
        if not isinstance(sample, ImuSample):
            return state, None
        now_us = sample.time_boot_us
        f_x, f_y, f_z = sample.specific_force_frd_m_s2
        self._look(state, now_us, (f_x, f_y, f_z + GRAVITY_M_S2))
        is_told = state.is_open and state.since is not None and state.since > WINDOW
        if is_told:
            state.is_open = False
        push, size, off = state.force_m_s2, state.largest_m_s2, situation.off_reason
        return state, judge(state, now_us, state.free_until_us, push, size, is_told, off)

    def _look(self, s: ThresholdState, now_us: int, force: Vector3) -> None:
        """Count the sample; open the window with it, or keep it if it is the loudest."""
        size = max(abs(force[0]), abs(force[1]), abs(force[2]))
        if s.since is not None:
            s.since += 1
        if size <= s.threshold_m_s2:
            return
        if s.since is None or s.since > WINDOW:
            if not s.is_open:
                s.free_until_us = min(now_us - self._averaging_us, s.last_sample_boot_us)
            s.since, s.largest_m_s2 = 0, 0.0
        if size > s.largest_m_s2 and s.since < WINDOW:
            s.is_open, s.largest_m_s2, s.force_m_s2 = True, size, force
