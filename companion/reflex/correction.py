"""How a vehicle's estimator corrects a velocity of which a clipped accelerometer hid a part, and until when.

PX4's estimator corrects it in a swing that looks like another hit. On a real PX4 the velocity was wrong by up to
7.8 m/s. It stayed so for 0.1 s, overshot by a fifth after 0.7 s, and the tilt was wrong for seconds.

The detector uses the validity: it must not take that swing for a second hit. A second hit jumps further than the swing
of the first one's speed. A recovery knows the normal and the expected rebound, too: it uses `motion_estimator`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from companion.motion.config import TILT_RAD_PER_M_S
from companion.reflex import config as reflex

Floats = npt.NDArray[np.float64]

# Hypotheses of the estimator's correction: delay in s, frequency in rad/s, damping. The last: nothing is missing.
_SOME = np.array([*product(reflex.CORRECTION_DELAY_S, reflex.CORRECTION_RAD_S, reflex.CORRECTION_DAMPING)])
_LATE_S, _RAD_S, _DAMPING = np.append(_SOME, _SOME[-1:], axis=0).T
_SWING, _SLOW, _ONE, _ZERO = 2.0 * _DAMPING * _RAD_S, reflex.TILT_PER_S, np.ones_like(_RAD_S), np.zeros_like(_RAD_S)
# The errors p of the position, u of the velocity and a of the tilt: p' = u - k p, u' = a - h p, a' = -m p, from
# p = delay, u = 1, a = 0. The poles are a swing of frequency f and damping d, and a slow decay c:
# s^3 + k s^2 + h s + m = (s^2 + 2 d f s + f^2) (s + c).
_K, _H, _M = _SWING + _SLOW, _RAD_S**2 + _SWING * _SLOW, _RAD_S**2 * _SLOW
_RATES = np.array([[-_K, _ONE, _ZERO], [-_H, _ZERO, _ONE], [-_M, _ZERO, _ZERO]])
_POLES, _SHAPES = np.linalg.eig(np.moveaxis(_RATES, 2, 0))
_MODES = _SHAPES * np.linalg.solve(_SHAPES, np.array([_LATE_S, _ONE, _ZERO]).T[..., None]).swapaxes(1, 2)

MODELS = len(_POLES)


def error_response(since_s: float) -> tuple[Floats, Floats, Floats]:
    """g, G in seconds, and the swing's remaining amplitude, of each model at a time after the hit."""
    x = np.maximum(since_s - _LATE_S, 0.0)
    way_s, g, _ = np.einsum("wim,wm->iw", _MODES, np.exp(_POLES * x[:, None])).real
    return g, way_s - np.maximum(_LATE_S - since_s, 0.0), np.exp(-0.5 * _SWING * x)


def tilt_response(errors: Floats, pushed_m_s2: Floats, elapsed_s: float) -> Floats:
    """The errors of position and velocity (2, models, axes) a time later: p' = u - k p, u' = -b - h p.

    b is the acceleration of a vehicle that is level by a wrong tilt: how the tilt came to be wrong does not matter.
    """
    p, u = errors
    k, h = _SWING[:, None], _RAD_S[:, None] ** 2
    return errors + elapsed_s * np.stack([u - k * p, -pushed_m_s2 - h * p])


@dataclass(slots=True)
class VelocityValidity:
    """Changed only by its methods. Times: vehicle's boot clock."""

    is_valid: bool = True  # whether the latest hit was measured whole, or has been corrected by now
    hit_boot_us: int = 0  # of the latest hit
    _is_again: bool = False
    """Whether the velocity was invalid already when the latest hit came: an earlier hit's part stays hidden."""
    is_disproved: bool = False  # whether a receiver's velocity shows that the vehicle's own is not right yet
    left_m_s: float = math.inf  # what is left to correct, once that is known
    _speed_m_s: float = 0.0  # of the latest hit, or of the hardest of those

    @property
    def is_known(self) -> bool:
        """Whether the velocity is valid, or by how much it is not."""
        return self.is_valid or math.isfinite(self.left_m_s)

    def tilt_error_rad(self, time_us: int) -> float:
        """By how much the reported tilt may be wrong: 0 if no hit is being corrected, or the correction cannot have
        begun."""
        is_right = self.is_valid or (not self._is_again and time_us - self.hit_boot_us < reflex.UNCORRECTED_US)
        return 0.0 if is_right else TILT_RAD_PER_M_S * (1.0 + self._speed_m_s)

    def correction_m_s(self, times_us: Sequence[int]) -> float:
        """By how much the newest of these velocities may differ from the mean of the others, because a hit is being
        corrected: by what is left of it, or an elastic one that was hidden whole, by the worst model of an estimator.
        What struck a vehicle that stood still may have done so at any speed."""
        if self.is_valid:
            return 0.0
        if self._speed_m_s < reflex.APPROACH_M_S or self.is_disproved:
            return self.left_m_s
        *before, newest = (error_response(1e-6 * (each - self.hit_boot_us))[0] for each in times_us)
        swing_m_s = 2.0 * self._speed_m_s * float(np.abs(newest - sum(before) / len(before)).max())
        return min(swing_m_s, self.left_m_s)

    def invalidate(self, time_us: int, speed_m_s: float) -> None:
        """A new hit, at this speed: the velocity is not valid until the hit is known to be measured whole."""
        self._is_again, self.is_valid, self.hit_boot_us = not self.is_valid, False, time_us
        self._speed_m_s = max(speed_m_s, self._speed_m_s) if self._is_again else speed_m_s

    def assess(self, is_fully_measured: bool) -> None:
        """Take whether the latest hit was measured whole, as known by now."""
        self.is_valid = is_fully_measured and (self.is_valid or not self._is_again)

    def update(self, time_us: int) -> None:
        self.is_valid = self.is_valid or (not self.is_disproved and time_us - self.hit_boot_us > reflex.CORRECTED_US)
