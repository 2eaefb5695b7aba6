"""A linear Kalman filter: mean and covariance carried on, and what was measured taken in (Kalman 1960).

Its update has Joseph's form, which keeps a covariance symmetric and positive whatever the rounding.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(slots=True)
class KalmanFilter:
    """`x` (n), `P` (n, n); changed only by `predict` and `update`."""

    x: Floats
    P: Floats

    def predict(self, F: Floats, Q: Floats) -> None:  # noqa: N803
        """Predict x = F x and P = F P F^T + Q. F: transition (n, n); Q: covariance of the process noise (n, n)."""
        self.x = F @ self.x
        self.P = F @ self.P @ F.T + Q

    def update(self, z: Floats, H: Floats, R: Floats) -> float:  # noqa: N803
        """Correct by a measurement z (m) = H x + noise of covariance R (m, m); H (m, n). Returns the normalised
        innovation squared (NIS), without unit.
        """
        innovation = z - H @ self.x
        covariance = self.P @ H.T
        inverse = np.linalg.inv(H @ covariance + R)
        gain = covariance @ inverse
        self.x = self.x + gain @ innovation
        left = np.eye(len(self.x)) - gain @ H
        self.P = left @ self.P @ left.T + gain @ R @ gain.T
        return float(innovation @ inverse @ innovation)
