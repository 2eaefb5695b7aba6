"""The companion's Kalman filter against filterpy's, on systems drawn at random."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as Reference

from companion.motion.kalman import KalmanFilter


def covariance(random, size):
    root = random.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


@pytest.mark.parametrize("seed", range(5))
def test_mean_covariance_and_innovation_are_filterpys(seed):
    random = np.random.default_rng(seed)
    n, m = 7, 3
    start = random.normal(size=n), covariance(random, n)
    own, reference = KalmanFilter(*start), Reference(dim_x=n, dim_z=m)
    reference.x, reference.P = start
    for _ in range(20):
        F, Q = np.eye(n) + 0.1 * random.normal(size=(n, n)), covariance(random, n)  # noqa: N806
        own.predict(F, Q)
        reference.predict(F=F, Q=Q)
        z, H, R = random.normal(size=m), random.normal(size=(m, n)), covariance(random, m)  # noqa: N806
        nis = own.update(z, H, R)
        reference.update(z, R=R, H=H)
        assert own.x == pytest.approx(reference.x) and pytest.approx(reference.P) == own.P
        assert nis == pytest.approx(reference.mahalanobis**2)


def test_what_is_certain_is_not_changed_and_what_is_unknown_is_believed():
    # Given a state of which the first number is known and the second is not
    own = KalmanFilter(np.array([1.0, 0.0]), np.diag([0.0, 1e12]))
    # When both are measured
    own.update(np.array([5.0, 7.0]), np.eye(2), np.eye(2))
    # Then only the second one follows
    assert own.x == pytest.approx([1.0, 7.0])
    assert np.diag(own.P) == pytest.approx([0.0, 1.0])
