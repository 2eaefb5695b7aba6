"""Detector `fuzzy`: a horizontal acceleration of more than 1 g.

After F. Chui, G. Dicker and I. Sharf, "Dynamics of a quadrotor undergoing impact with a wall" (ICUAS 2016) and
G. Dicker, I. Sharf and P. Rustagi, "Recovery control for quadrotor UAV colliding with a pole" (IROS 2018), held against
the authors' program for PX4, github.com/fionachui/PX4-Firmware_Recovery, src/modules/impact_detection.

A collision is an accelerometer reading whose horizontal part, in the world, exceeds 9.81 m/s^2; the next one counts
when it has been below that again. The fuzzy process that gives the method its name rates a collision that is found: how
hard their reaction accelerates away from the wall. It finds none, and is left out: the recovery laws here answer to v_c
and the normal, which are measured.

Not theirs: one contact is told once (`contact`); the detector is off when the flight says so. The articles themselves
were not at hand.
"""

import math
from dataclasses import dataclass

from bench.detectors.contact import Baseline, judge
from companion.messages import Attitude, ImuSample, Quaternion, Sample
from companion.motion.rotation import body_to_ned
from companion.motion.strapdown import LEVEL
from companion.reflex.detector import DetectorState, Impact, Situation


@dataclass(slots=True)
class FuzzyState(DetectorState):
    """Adds the attitude; changed in place."""

    attitude_wxyz: Quaternion = LEVEL


class FuzzyDetector(Baseline):
    """See the module's text."""

    name, state = "fuzzy", FuzzyState

    def step(self, state: FuzzyState, sample: Sample, situation: Situation) -> tuple[FuzzyState, Impact | None]:
        if isinstance(sample, Attitude):
            state.attitude_wxyz = sample.attitude_wxyz
        if not isinstance(sample, ImuSample):
            return state, None
        f, now_us = sample.specific_force_frd_m_s2, sample.time_boot_us
        north, east, _ = body_to_ned(state.attitude_wxyz, f)
        size = math.hypot(north, east)
        free_until_us = min(now_us - self._averaging_us, state.last_sample_boot_us)
        is_loud = size > state.threshold_m_s2
        return state, judge(state, now_us, free_until_us, (f[0], f[1], 0.0), size, is_loud, situation.off_reason)
