"""Detector `fuzzy`: a horizontal acceleration of more than 1 g, rated by a fuzzy process to a response intensity.

After F. Chui, G. Dicker and I. Sharf, "Dynamics of a quadrotor undergoing impact with a wall" (ICUAS 2016) and
G. Dicker, I. Sharf and P. Rustagi, "Recovery control for quadrotor UAV colliding with a pole" (IROS 2018), held against
the authors' program for PX4, github.com/fionachui/PX4-Firmware_Recovery, src/modules/impact_detection and
src/modules/impact_characterization (sets and rules also in McGill-AML/RecoveryControl-MATLABSimulator).

A collision is an accelerometer reading whose horizontal part, in the world, exceeds 9.81 m/s^2; the next one counts
when it has been below that again. Four inputs rate it:

    A  size of the accelerometer's body x and y, g        I  inclination towards (+) or away from the wall, degrees
    G  angle of the flip to the wall's normal, degrees    W  size of the rates about body x and y, rad/s

each by trapezoids (`SETS`); minimum for "and", maximum for "or", the outputs cut at their rule's degree, joined by the
maximum, and the centre of their area is the intensity R in [-1, 1] (Mamdani). The reaction accelerates by 0.75 g times
R away from the wall, and not at all where R is negative: that share, 0 to 1, is told as the impact's confidence. It
scales nothing here: the recovery laws answer to v_c and the normal, which are measured.

Not theirs: all inputs are of the first sample, where theirs take A two, and W three, sensor readings later; one
contact is told once (`contact`); the detector is off when the flight says so. The articles themselves were not at hand.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bench.detectors.contact import Baseline, judge
from companion.messages import Attitude, ImuSample, Quaternion, Sample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned
from companion.motion.strapdown import LEVEL
from companion.reflex.detector import DetectorState, Impact, Situation
from companion.strict_model import Positive, StrictModel

# Trapezoids: where each begins to rise, is whole, begins to fall, is nothing again.
SETS: dict[str, tuple[float, float, float, float]] = {
    "A very low": (0.0, 0.0, 0.0, 2.0),
    "A low": (0.0, 2.0, 2.0, 4.0),
    "A medium": (2.0, 4.0, 4.0, 6.0),
    "A high": (4.0, 6.0, 10.0, 10.0),
    "I away big": (-90.0, -60.0, -15.0, -8.0),
    "I away small": (-9.5, -5.5, -5.5, -1.5),
    "I level": (-2.0, 0.0, 0.0, 2.0),
    "I toward small": (1.5, 5.5, 5.5, 9.5),
    "I toward big": (8.0, 15.0, 60.0, 90.0),
    "G away": (0.0, 0.0, 50.0, 90.0),
    "G toward": (90.0, 130.0, 180.0, 180.0),
    "W low": (0.0, 0.0, 0.5, 1.5),
    "W medium": (1.0, 1.5, 3.0, 3.5),
    "W high": (3.0, 4.5, 15.0, 15.0),
}
AWAY_BIG, AWAY_SMALL, LEVEL_OUT = (-1.0, -1.0, -0.9, -0.6), (-0.9, -0.6, -0.4, -0.1), (-0.4, -0.1, 0.1, 0.4)
TOWARD_SMALL, TOWARD_BIG = (0.1, 0.4, 0.6, 0.9), (0.6, 0.9, 1.0, 1.0)
# All of the sets named must hold, then the output.
RULES: tuple[tuple[tuple[str, ...], tuple[float, float, float, float]], ...] = (
    (("A very low",), LEVEL_OUT),
    (("A low", "I toward small"), TOWARD_SMALL),
    (("A low", "I toward big"), TOWARD_SMALL),
    (("A medium", "I toward small"), TOWARD_SMALL),
    (("A low", "I away small"), AWAY_SMALL),
    (("A low", "I away big"), AWAY_SMALL),
    (("A medium", "I away small"), AWAY_SMALL),
    (("A high", "I toward small"), TOWARD_BIG),
    (("A high", "I toward big"), TOWARD_BIG),
    (("A medium", "I toward big"), TOWARD_BIG),
    (("A high", "I away small"), AWAY_BIG),
    (("A high", "I away big"), AWAY_BIG),
    (("A medium", "I away big"), AWAY_BIG),
    (("A low", "I level"), LEVEL_OUT),
    (("A medium", "I level"), TOWARD_SMALL),
    (("A high", "I level"), TOWARD_SMALL),
    (("W low",), LEVEL_OUT),
    (("W medium", "G toward"), TOWARD_SMALL),
    (("W medium", "G away"), AWAY_SMALL),
    (("W high", "G toward"), TOWARD_BIG),
    (("W high", "G away"), AWAY_BIG),
)
# Steps of a hundredth make an area's centre good to less than that.
OUTPUTS = 201
# The sets end here; what is more counts as the most.
MOST = {"A": 10.0, "I": 90.0, "G": 180.0, "W": 15.0}


class FuzzyConfig(StrictModel):
    """Settings of the detector `fuzzy`, as in its authors' program."""

    threshold_m_s2: Positive = 9.81


@dataclass(slots=True)
class FuzzyState(DetectorState):
    """Adds the attitude; changed in place."""

    attitude_wxyz: Quaternion = LEVEL


class FuzzyDetector(Baseline):
    """See the module's text."""

    name = "fuzzy"

    def initial(self) -> FuzzyState:
        return FuzzyState(threshold_m_s2=self._config.threshold_m_s2)

    def step(self, state: FuzzyState, sample: Sample, situation: Situation) -> tuple[FuzzyState, Impact | None]:
        if isinstance(sample, Attitude):
            state.attitude_wxyz = sample.attitude_wxyz
        if not isinstance(sample, ImuSample):
            return state, None
        f = sample.specific_force_frd_m_s2
        north, east, _ = body_to_ned(state.attitude_wxyz, f)
        size = math.hypot(north, east)
        now_us = sample.time_boot_us
        free_until_us = min(now_us - self._averaging_us, state.last_sample_boot_us)
        is_loud = size > state.threshold_m_s2
        push = (f[0], f[1], 0.0)
        impact = judge(state, now_us, free_until_us, push, size, is_loud, situation.off_reason)
        if impact is None:
            return state, None
        normal = (north / size, east / size, 0.0)
        response = intensity(
            math.hypot(f[0], f[1]) / GRAVITY_M_S2,
            inclination_deg(state.attitude_wxyz, normal),
            flip_deg(body_to_ned(state.attitude_wxyz, sample.angular_velocity_frd_rad_s), normal),
            math.hypot(*sample.angular_velocity_frd_rad_s[:2]),
        )
        return state, Impact(now_us, free_until_us, push, confidence=max(0.0, response))


def inclination_deg(attitude_wxyz: Quaternion, normal_ned: Vector3) -> float:
    """Of the thrust against the vertical, in the plane of vertical and normal; positive towards the wall."""
    up_n, up_e, up_d = body_to_ned(attitude_wxyz, (0.0, 0.0, -1.0))
    away = up_n * normal_ned[0] + up_e * normal_ned[1]
    return math.degrees(math.atan2(-away, -up_d))


def flip_deg(rates_ned_rad_s: Vector3, normal_ned: Vector3) -> float:
    """Between the way the vehicle's top turns and the level normal: 0 away from the wall, 180 towards it."""
    p, q, _ = rates_ned_rad_s
    # w x (0, 0, -1)
    north, east = -q, p
    size = math.hypot(north, east)
    if size == 0.0:
        return 90.0
    return math.degrees(math.acos(max(-1.0, min(1.0, (north * normal_ned[0] + east * normal_ned[1]) / size))))


def intensity(a: float, i: float, g: float, w: float) -> float:
    """R of the module's text, in its units; 0 where no rule holds."""
    inputs = {"A": a, "I": i, "G": g, "W": w}
    degrees = {name: _degree(corners, inputs[name[0]], MOST[name[0]]) for name, corners in SETS.items()}
    area = np.zeros(OUTPUTS)
    for names, output in RULES:
        area = np.maximum(area, np.minimum(min(degrees[name] for name in names), _output(output)))
    total = float(area.sum())
    return float((area * np.linspace(-1.0, 1.0, OUTPUTS)).sum()) / total if total > 0.0 else 0.0


def _degree(corners: tuple[float, float, float, float], value: float, most: float) -> float:
    """How far a value belongs to a trapezoid, 0 to 1."""
    begins, whole, falls, ends = corners
    x = max(-most, min(most, value))
    if whole <= x <= falls:
        return 1.0
    if begins < x < whole:
        return (x - begins) / (whole - begins)
    return (ends - x) / (ends - falls) if falls < x < ends else 0.0


@lru_cache
def _output(corners: tuple[float, float, float, float]) -> npt.NDArray[np.float64]:
    return np.array([_degree(corners, float(x), 1.0) for x in np.linspace(-1.0, 1.0, OUTPUTS)])
