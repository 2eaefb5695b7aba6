"""Wind that changes: the discrete gust and the continuous turbulence of MIL-F-8785C."""

import math

import numpy as np

from sim_vehicle.faults.group import Group
from sim_vehicle.faults.spec import Gust, Turbulence
from sim_vehicle.physics.layout import Disturbance, PlantState
from sim_vehicle.quantities import Vector3

_FOOT_M = 0.3048
# The model's low-altitude figures hold from 10 ft up to 1000 ft.
_LOWEST_FT, _HIGHEST_FT = 10.0, 1000.0
# Turbulence is carried past the vehicle by the wind or by its own flight; standing still in calm air it would not
# change at all.
_SLOWEST_M_S = 1.0
_ROOT_3 = math.sqrt(3.0)


def risen(time_s: float, start_s: float, end_s: float, rise_s: float) -> float:
    """Share of something that rises from ``start_s`` on and is gone at ``end_s``, half a cosine each way."""
    since_s, left_s = time_s - start_s, end_s - time_s
    nearest_s = min(since_s, left_s)
    if nearest_s <= 0.0:
        return 0.0
    return 1.0 if nearest_s >= rise_s else 0.5 * (1.0 - math.cos(math.pi * nearest_s / rise_s))


def strengths_and_lengths(height_m: float, wind_20ft_m_s: float) -> tuple[float, float, float, float]:
    """Standard deviations (m/s, along and across the wind, then vertical) and lengths (m, likewise).

    MIL-F-8785C, low-altitude model: L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2, sigma_w = 0.1 W20,
    sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4, h in feet.
    """
    height_ft = min(max(height_m / _FOOT_M, _LOWEST_FT), _HIGHEST_FT)
    base = 0.177 + 0.000823 * height_ft
    vertical_m_s = 0.1 * wind_20ft_m_s
    return vertical_m_s / base**0.4, vertical_m_s, height_ft / base**1.2 * _FOOT_M, height_ft * _FOOT_M


class Dryden:
    """Noise through Dryden's forming filters: first order along the wind, second order across it and vertically."""

    def __init__(self, wind_20ft_m_s: float, along_ned: Vector3, step_s: float, rng: np.random.Generator) -> None:
        """``along_ned`` is the mean wind's direction; without one, north."""
        self._wind_20ft_m_s = wind_20ft_m_s
        length = math.hypot(along_ned[0], along_ned[1])
        self._north, self._east = (along_ned[0] / length, along_ned[1] / length) if length > 0.0 else (1.0, 0.0)
        self._step_s = step_s
        self._rng = rng
        # In units of the standard deviation: along; across and vertical as two states each, stationary from the start.
        self._along, self._across, self._down = rng.standard_normal(), self._settled(), self._settled()

    def next(self, height_m: float, airspeed_m_s: float) -> Vector3:
        """Velocity of the air (NED, m/s) one step later, at a height above ground and a speed through the air."""
        level_m_s, vertical_m_s, level_m, vertical_m = strengths_and_lengths(height_m, self._wind_20ft_m_s)
        speed_m_s = max(airspeed_m_s, _SLOWEST_M_S)
        level_step, vertical_step = self._step_s * speed_m_s / level_m, self._step_s * speed_m_s / vertical_m
        first, second, third = self._rng.standard_normal(3).tolist()
        keep = math.exp(-level_step)
        self._along = keep * self._along + math.sqrt(1.0 - keep * keep) * first
        along_m_s = level_m_s * self._along
        across_m_s = level_m_s * self._stepped(self._across, level_step, second)
        down_m_s = vertical_m_s * self._stepped(self._down, vertical_step, third)
        north, east = self._north, self._east
        return north * along_m_s - east * across_m_s, east * along_m_s + north * across_m_s, down_m_s

    def _settled(self) -> list[float]:
        """Both states as they are after a long time: variances 1/2 and 1/4, covariance 1/4, of q = sigma^2 T."""
        first, second = self._rng.standard_normal(2).tolist()
        return [math.sqrt(0.5) * first, math.sqrt(0.125) * first + math.sqrt(0.125) * second]

    @staticmethod
    def _stepped(state: list[float], step: float, noise: float) -> float:
        """(1 + sqrt(3) T s) / (1 + T s)^2 of noise that makes the output's variance one; ``step`` in units of T."""
        keep, (first, second) = math.exp(-step), state
        state[0] = keep * first + math.sqrt(0.5 * (1.0 - keep * keep)) * noise
        state[1] = keep * second + (1.0 - keep) * 0.5 * (first + state[0])
        return _ROOT_3 * state[0] + (1.0 - _ROOT_3) * state[1]


class Air(Group[Gust | Turbulence]):
    """The wind of a flight: the steady one, gusts and turbulence together."""

    def __init__(self, steady_ned_m_s: Vector3, step_s: float, rng: np.random.Generator) -> None:
        super().__init__()
        self._steady_ned_m_s = np.array(steady_ned_m_s)
        self._along_ned, self._step_s, self._rng = steady_ned_m_s, step_s, rng
        self._drydens: dict[int, Dryden] = {}

    def add(self, fault: Gust | Turbulence) -> None:
        super().add(fault)
        if isinstance(fault, Turbulence):
            self._drydens[id(fault)] = Dryden(fault.wind_20ft_m_s, self._along_ned, self._step_s, self._rng)

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        """Write the wind (NED, m/s) at this boot time into ``disturbance``: steady, gusts and turbulence."""
        wind = self._steady_ned_m_s.copy()
        for gust in self._faults:
            if isinstance(gust, Gust):
                wind += risen(time_s, *gust.window_s, gust.rise_s) * np.array(gust.velocity_ned_m_s)
        for fault in self.acting(time_s):
            if isinstance(fault, Turbulence):
                airspeed_m_s = float(np.linalg.norm(state.body[3:6] - self._steady_ned_m_s))
                wind += self._drydens[id(fault)].next(-float(state.body[2]), airspeed_m_s)
        disturbance.wind_ned_m_s[:] = wind
