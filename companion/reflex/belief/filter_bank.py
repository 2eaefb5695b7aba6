"""A bank of Kalman filters of the motion after a hit, one for each model of how the vehicle's estimate corrects itself.

PX4's estimator corrects a velocity of which a clipped accelerometer hid a part in a swing that looks like another hit.
On a real PX4 the velocity was wrong by up to 7.8 m/s. It stayed so for 0.1 s, overshot by a fifth after 0.7 s, and the
tilt was wrong for seconds.
"""

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from companion.messages import Vector3
from companion.motion.config import DRIFT_M2_S3
from companion.motion.vector import ZERO, minus
from companion.reflex import config as reflex
from companion.reflex.surface import MotionState

Floats = npt.NDArray[np.float64]

# Hypotheses of the estimator's correction: delay in s, frequency in rad/s. The last: nothing is missing.
_SOME = np.array([*product(reflex.CORRECTION_DELAY_S, reflex.CORRECTION_RAD_S)])
_LATE_S, _RAD_S = np.append(_SOME, _SOME[-1:], axis=0).T
_SWING, _SLOW = 2.0 * reflex.CORRECTION_DAMPING * _RAD_S, reflex.TILT_PER_S
# The errors p of the position, u of the velocity and a of the tilt: p' = u - k p, u' = a - h p, a' = -m p, from
# p = delay, u = 1, a = 0. The poles are a swing of frequency f and damping d, and a slow decay c:
# s^3 + k s^2 + h s + m = (s^2 + 2 d f s + f^2) (s + c). By Laplace p = s (delay s + 1) / (s^3 + k s^2 + h s + m).
_K, _H = _SWING + _SLOW, _RAD_S**2 + _SWING * _SLOW
_TURN_RAD_S = 1j * _RAD_S * math.sqrt(1.0 - reflex.CORRECTION_DAMPING**2)
_POLES = np.array([_TURN_RAD_S - 0.5 * _SWING, -_TURN_RAD_S - 0.5 * _SWING, np.full_like(_SWING, -_SLOW)])
_WAYS = _POLES * (_LATE_S * _POLES + 1.0) / (3.0 * _POLES**2 + 2.0 * _K * _POLES + _H)
_MODES = np.array([_WAYS, (_POLES + _K) * _WAYS])


def error_response(since_s: float) -> tuple[Floats, Floats, Floats]:
    """g, G in seconds, and the swing's remaining amplitude, of each model at a time after the hit."""
    x = np.maximum(since_s - _LATE_S, 0.0)
    way_s, g = (_MODES * np.exp(_POLES * x)).sum(axis=1).real
    return g, way_s - np.maximum(_LATE_S - since_s, 0.0), np.exp(-0.5 * _SWING * x)


def tilt_response(errors: Floats, pushed_m_s2: Floats, elapsed_s: float) -> Floats:
    """The errors of position and velocity (2, models, axes) a time later: p' = u - k p, u' = -b - h p.

    b is the acceleration of a vehicle that is level by a wrong tilt: how the tilt came to be wrong does not matter.
    """
    p, u = errors
    k, h = _SWING[:, None], _RAD_S[:, None] ** 2
    return errors + elapsed_s * np.stack([u - k * p, -pushed_m_s2 - h * p])


class FilterBank:
    """Kalman filters of x, v, e: states (models, axes, 3), covariances of each axis (models, 3, 3); in the last e = 0.

    Local NED, SI. Changed only by its methods. `log_likelihoods` are twice the logarithm of each model's likelihood.
    """

    def __init__(
        self,
        start: MotionState,
        spread_m_s: float,
        error_m_s: Vector3,
        time_boot_us: int,
        summed_m_s: Vector3 = ZERO,
    ) -> None:
        """`spread_m_s` is the standard deviation of the velocity at the start, `error_m_s` the first estimate of e.

        `summed_m_s`: the accelerometer's integral until then.
        """
        self.time_boot_us, self._summed_m_s = time_boot_us, summed_m_s
        models, state = len(_RAD_S), np.stack([start.position_ned_m, start.velocity_ned_m_s, error_m_s], axis=1)
        spreads = (reflex.PLACE_SPREAD_M, spread_m_s, math.hypot(*error_m_s) + spread_m_s)
        self.state = np.tile(state, (models, 1, 1))
        self.covariance = np.tile(np.diag(np.square(spreads)), (models, 1, 1))
        self.log_likelihoods, self.leaves = np.zeros(models), np.ones(models)
        self.tilted = np.zeros((2, models, 3))  # errors of what is reported by a tilt that is wrong across e
        self.state[-1, :, 2] = self.covariance[-1, 2, 2] = 0.0
        self.log_likelihoods[-1] = 2.0 * math.log(models)  # as likely as all others together

    def drop_errors(self) -> None:
        """What is reported is right: the model without an error counts alone."""
        self.log_likelihoods[:-1] = -math.inf

    def predict(self, time_boot_us: int, summed_m_s: Vector3, level_m_s2: Vector3) -> None:
        """Up to a time, with the accelerometer's integral until then; its attitude may be slightly wrong.

        `level_m_s2`: acceleration of a vehicle that is level by its own tilt. Along e the models contain it.
        """
        elapsed_s, added = 1e-6 * (time_boot_us - self.time_boot_us), np.array(minus(summed_m_s, self._summed_m_s))
        self.time_boot_us, self._summed_m_s = time_boot_us, summed_m_s
        hidden, pushed = self.state[..., 2], np.array(level_m_s2)
        along_e = hidden @ pushed / np.maximum((hidden**2).sum(axis=1), 1e-9)
        self.tilted = tilt_response(self.tilted, pushed - along_e[:, None] * hidden, elapsed_s)
        leads = np.array([[1.0, elapsed_s, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        self.state = self.state @ leads.T + added[:, None] * [0.5 * elapsed_s, 1.0, 0.0]
        self.covariance = leads @ self.covariance @ leads.T
        self.covariance[:, 1, 1] += DRIFT_M2_S3 * elapsed_s

    def update(self, which: int, share: Floats, measured: Vector3, variance: float) -> None:
        """Take a reported position (0) or velocity (1), with each model's share of e in it."""
        missed = np.array(measured) - self.state[..., which] - share[:, None] * self.state[..., 2] - self.tilted[which]
        with_it = self.covariance[:, which] + share[:, None] * self.covariance[:, 2]
        size = with_it[:, which] + share * with_it[:, 2] + variance
        gain = with_it / size[:, None]
        self.state = self.state + missed[..., None] * gain[:, None]
        self.covariance = self.covariance - with_it[..., None] * gain[:, None]
        self.log_likelihoods = self.log_likelihoods - (missed**2).sum(axis=1) / size - 3.0 * np.log(size)

    def leave(self, normal: Vector3, along_m_s: float, error_rad: float) -> None:
        """Take that no vehicle goes on into what it has hit: the probability that a model's velocity left it.

        `along_m_s`: what the vehicle's own thrust has added since; `error_rad`: of the normal.
        """
        velocity, variance = self.state[..., 1], self.covariance[:, 1, 1]
        off_m_s = velocity @ np.array(normal) - along_m_s
        spread2 = variance + error_rad**2 * (velocity**2).sum(axis=1)
        # As steep at zero as the normal distribution's.
        self.leaves = np.maximum(0.5 + 0.5 * np.tanh(math.sqrt(2.0 / math.pi) * off_m_s / np.sqrt(spread2)), 1e-9)

    def estimate(self, left: Floats) -> tuple[MotionState, float, float]:
        """Motion, largest standard deviation of its velocity, largest further swing of the reported velocity.

        `left` is each model's remaining amplitude.
        """
        share = self._probabilities()
        (x, y, z), (u, v, w), _ = np.einsum("w,wai->ia", share, self.state).tolist()
        spread2 = (share @ (self.covariance[:, 1, 1, None] + (self.state[..., 1] - [u, v, w]) ** 2)).max()
        left2 = share @ (left**2 * (3.0 * self.covariance[:, 2, 2] + (self.state[..., 2] ** 2).sum(axis=1)))
        return MotionState((x, y, z), (u, v, w)), math.sqrt(spread2), math.sqrt(left2)

    def _probabilities(self) -> Floats:
        """Probability of each model."""
        share: Floats = np.exp(0.5 * (self.log_likelihoods - self.log_likelihoods.max())) * self.leaves
        share /= share.sum()
        return share
