"""A bank of Kalman filters of the motion after a hit, one for each model of how the vehicle's estimate corrects itself.

At a time t after the hit the vehicle reports v(t) + e g(t) and x(t) + e G(t), where e is what the accelerometer did not
show of the hit (see `correction`). Each model is weighted by the likelihood of its innovations (Magill 1965).
"""

import math

import numpy as np

from companion.messages import Vector3
from companion.motion.vector import ZERO
from companion.reflex import config as reflex
from companion.reflex.correction import MODELS, Floats, tilt_response
from companion.reflex.laws import MotionState

LEVEL_AXES, DOWN_AXIS, ALL_AXES = slice(0, 2), slice(2, 3), slice(0, 3)
NOTHING = np.zeros(MODELS)


class FilterBank:
    """Kalman filters of x, v, e, b: states (models, axes, 4), covariances (models, axes, 4, 4); in the last e = 0.

    b is the acceleration that the accelerometer does not show, as its attitude is wrong: 0 until a receiver shows it.

    Local NED, SI. Changed only by its methods. `log_likelihoods` are twice the logarithm of each model's likelihood.
    """

    __slots__ = ("covariance", "leaves", "log_likelihoods", "state", "tilted")

    def __init__(self, start: MotionState, spread_m_s: float, error_m_s: Vector3) -> None:
        """`spread_m_s` is the standard deviation of the velocity at the start, `error_m_s` the first estimate of e."""
        models = MODELS
        state = np.stack([start.position_ned_m, start.velocity_ned_m_s, error_m_s, ZERO], axis=1)
        spreads = (reflex.PLACE_SPREAD_M, spread_m_s, math.hypot(*error_m_s) + spread_m_s, 0.0)
        self.state = np.tile(state, (models, 1, 1))
        self.covariance = np.tile(np.diag(np.square(spreads)), (models, 3, 1, 1))
        self.log_likelihoods, self.leaves = np.zeros(models), np.ones(models)
        self.tilted = np.zeros((2, models, 3))  # errors of what is reported by a tilt that is wrong across e
        self.state[-1, :, 2] = self.covariance[-1, :, 2, 2] = 0.0
        self.log_likelihoods[-1] = 2.0 * math.log(models)  # as likely as all others together

    def predict(self, elapsed_s: float, faster_m_s: Vector3, level_m_s2: Vector3) -> None:
        """Predict over a time, with the accelerometer's integral; its attitude may be slightly wrong.

        `level_m_s2`: acceleration of a vehicle that is level by its own tilt. Along e the models contain it.
        """
        hidden, pushed = self.state[..., 2], np.array(level_m_s2)
        along_e = hidden @ pushed / np.maximum((hidden**2).sum(axis=1), 1e-9)
        self.tilted = tilt_response(self.tilted, pushed - along_e[:, None] * hidden, elapsed_s)
        leads, added = np.eye(4), np.array(faster_m_s)
        leads[0, 1] = leads[1, 3] = elapsed_s
        leads[0, 3] = 0.5 * elapsed_s**2
        self.state = self.state @ leads.T + added[:, None] * [0.5 * elapsed_s, 1.0, 0.0, 0.0]
        self.covariance = leads @ self.covariance @ leads.T
        self.covariance[..., 1, 1] += reflex.DRIFT_M2_S3 * elapsed_s

    def update(self, which: int, share: Floats, measured: Vector3, variance: float, axes: slice) -> None:
        """Take a reported position (0) or velocity (1) on some axes, with each model's share of e in it."""
        self._update(which, share, np.array(measured) - self.tilted[which], variance, axes)

    def measure(self, velocity: Vector3, variance: float) -> None:
        """Take a horizontal velocity that has no part of e in it."""
        if self.covariance[0, 0, 3, 3] == 0.0:
            self.covariance[:, LEVEL_AXES, 3, 3] = reflex.LEVEL_SPREAD_M_S2**2
        self._update(1, NOTHING, np.tile(velocity, (MODELS, 1)), variance, LEVEL_AXES)

    def _update(self, which: int, share: Floats, measured: Floats, variance: float, axes: slice) -> None:
        share, state, covariance = share[:, None], self.state[:, axes], self.covariance[:, axes]
        missed = measured[:, axes] - state[..., which] - share * state[..., 2]
        with_it = covariance[..., which] + share[..., None] * covariance[..., 2]
        size = with_it[..., which] + share * with_it[..., 2] + variance
        gain = with_it / size[..., None]
        self.state[:, axes] += missed[..., None] * gain
        self.covariance[:, axes] -= with_it[..., None] * gain[..., None, :]
        self.log_likelihoods -= (missed**2 / size + np.log(size)).sum(axis=1)

    def leave(self, normal: Vector3, along_m_s: float, error_rad: float) -> None:
        """Take that no vehicle goes on into what it has hit: the probability that a model's velocity left it.

        `along_m_s`: what the vehicle's own thrust has added since; `error_rad`: of the normal.
        """
        velocity, variance = self.state[..., 1], self.covariance[..., 1, 1] @ np.square(normal)
        off_m_s = velocity @ np.array(normal) - along_m_s
        spread2 = variance + error_rad**2 * (velocity**2).sum(axis=1)
        self.leaves = np.maximum(0.5 + 0.5 * np.tanh(0.5 * reflex.LOGISTIC * off_m_s / np.sqrt(spread2)), 1e-9)

    def estimate(self, left: Floats) -> tuple[MotionState, float, float]:
        """Motion, largest standard deviation of its velocity, largest further swing of the reported velocity.

        `left` is each model's remaining amplitude.
        """
        share = self._probabilities()
        (x, y, z), (u, v, w), _, _ = np.einsum("w,wai->ia", share, self.state).tolist()
        spread2 = (share @ (self.covariance[..., 1, 1] + (self.state[..., 1] - [u, v, w]) ** 2)).max()
        left2 = share @ (left**2 * (self.covariance[..., 2, 2] + self.state[..., 2] ** 2).sum(axis=1))
        return MotionState((x, y, z), (u, v, w)), math.sqrt(spread2), math.sqrt(left2)

    def unseen(self) -> Vector3:
        """Mean acceleration that the accelerometer does not show."""
        n, e, d = (self._probabilities() @ self.state[..., 3]).tolist()
        return (n, e, d)

    def mean_error(self, which: int, share: Floats) -> Vector3:
        """Mean error of the reported position (0) or velocity (1), with each model's share of e in it."""
        n, e, d = (self._probabilities() @ (share[:, None] * self.state[..., 2] + self.tilted[which])).tolist()
        return (n, e, d)

    def _probabilities(self) -> Floats:
        """Probability of each model."""
        share: Floats = np.exp(0.5 * (self.log_likelihoods - self.log_likelihoods.max())) * self.leaves
        share /= share.sum()
        return share
