"""How fast a vehicle moves after a hit of which its estimate lacks a part, from how the estimate is put right.

What clipping hides of a hit, e, is missing in the estimated velocity, and then in the place. Other sensors put both
right, as an estimator of second order does (docs/px4.md), t after the hit

    v(t) = w + s(t) + e g(t),    x(t) = x_c + w t + S(t) + e G(t)

with w the speed after the hit, the accelerometer's sum s since then and its sum S. The throw itself is what is missing
most, so e = v_c - w + d, and w and d are two unknowns in every velocity and every place. As long as nothing is put
right, g = 1 and G = t, nothing is told of w; a quarter of a second after the hit it is.
"""

import math
from dataclasses import dataclass

# A real PX4's, in three hits (airframe file, estimate.clipping; docs/px4.md).
PUT_RIGHT_AFTER_S, FREQUENCY_RAD_S, DAMPING = 0.12, 4.45, 0.59
_SLOWING, _TURNING = DAMPING * FREQUENCY_RAD_S, FREQUENCY_RAD_S * math.sqrt(1.0 - DAMPING**2)
# d: in clipped hits in simulation, vertically.
HIDDEN_SPREAD_M_S = 0.2
# A good estimate's noise, 0.03 m/s for 0.3 s and 1 cm for seconds, as if each of 50 samples a second were for itself.
VELOCITY_SPREAD_M_S, PLACE_SPREAD_M = 0.15, 0.03


@dataclass(slots=True)
class Unseen:
    """The two unknowns on one axis, by least squares; SI. Changed only by its methods."""

    before_m_s: float
    expected_m_s: float
    spread_m_s: float
    _ww: float = 0.0
    _wd: float = 0.0
    _dd: float = 1.0 / HIDDEN_SPREAD_M_S**2
    _w: float = 0.0
    _d: float = 0.0

    def told(self, since_s: float, speed_m_s: float, way_m: float | None) -> None:
        """An estimate of so long after the hit, less what the accelerometer has summed up since."""
        g, way_s = missing(since_s)
        self._add(1.0 - g, g, speed_m_s - g * self.before_m_s, VELOCITY_SPREAD_M_S)
        if way_m is not None:
            self._add(since_s - way_s, way_s, way_m - way_s * self.before_m_s, PLACE_SPREAD_M)

    def _add(self, of_w: float, of_d: float, value: float, spread: float) -> None:
        weight = spread**-2
        self._ww += weight * of_w * of_w
        self._wd += weight * of_w * of_d
        self._dd += weight * of_d * of_d
        self._w += weight * of_w * value
        self._d += weight * of_d * value

    @property
    def speed_m_s(self) -> float:
        """After the hit."""
        weight = self.spread_m_s**-2
        ww, w = self._ww + weight, self._w + weight * self.expected_m_s
        return (self._dd * w - self._wd * self._d) / (self._dd * ww - self._wd * self._wd)


def missing(since_s: float) -> tuple[float, float]:
    """g and G: what is missing in the estimated velocity and, in seconds, in the place, of what was hidden."""
    late_s = PUT_RIGHT_AFTER_S
    if since_s <= late_s:
        return 1.0, since_s
    x = since_s - late_s
    # The place's error p: p' = u - 2 d f p, u' = -f^2 p, from p = late_s, u = 1.
    rate = (1.0 - _SLOWING * late_s) / _TURNING
    cos, sin, left = math.cos(_TURNING * x), math.sin(_TURNING * x), math.exp(-_SLOWING * x)
    place = left * (late_s * cos + rate * sin)
    slope = left * (_TURNING * (rate * cos - late_s * sin)) - _SLOWING * place
    return slope + 2.0 * _SLOWING * place, place
