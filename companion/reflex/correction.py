"""How a vehicle's estimator corrects a velocity of which a clipped accelerometer hid a part.

PX4's estimator corrects it in a swing that looks like another hit. On a real PX4 the velocity was wrong by up to
7.8 m/s. It stayed so for 0.1 s, overshot by a fifth after 0.7 s, and the tilt was wrong for seconds.
"""

from itertools import product

import numpy as np
import numpy.typing as npt

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
