"""Estimates that jump, drift, or are led astray."""

import math
import random
from collections.abc import Callable

from bench.faults.injectors import Simulated, adding, flying, rewriting
from bench.fly.air import COMPLETED, HANDED_OVER, Expected, Fault, Injector, When
from bench.fly.packets import ODOMETRY, POSITION
from sim_vehicle.bench.faults import ekf_reset, gps_loss, other

_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)


def _reset(position_m: float, velocity_m_s: float) -> Callable[[random.Random], Injector]:
    """Sideways from any side."""

    def make(chance: random.Random) -> Injector:
        north, east = (f(chance.uniform(-math.pi, math.pi)) for f in (math.cos, math.sin))
        jump, hop = (position_m * north, position_m * east, 0.0), (velocity_m_s * north, velocity_m_s * east, 0.0)
        return Simulated(ekf_reset(jump, hop), When.flying(chance))

    return make


def _height_reset(chance: random.Random) -> Injector:
    jump_m = chance.choice((-0.5, 0.5))
    return Simulated(ekf_reset((0.0, 0.0, jump_m)), When.flying(chance))


_OF_VELOCITIES = (POSITION, ODOMETRY)
_HEIGHT = "the estimated height jumps and says so"
_CLIPPED = "four velocity resets of 0.3 m/s within 36 ms of a hit that clipped"
_PUT = "in what the companion hears"

FAULTS = (
    Fault("position reset 3 m", "the estimate jumps sideways and says so", _reset(3.0, 0.0), _MAY_END),
    Fault(
        "velocity reset 1 m/s",
        "the estimated velocity jumps and says so, and finds back",
        _reset(0.0, 1.0),
        Expected(finds=False),
    ),
    Fault("height reset 0.5 m", _HEIGHT, _height_reset, _MAY_END),
    Fault("resets after clipping", _CLIPPED, flying(other("estimator_after_clipping"))),
    Fault("GPS lost", "no fix from the cruise on; the velocity drifts", flying(gps_loss()), _MAY_END),
    Fault(
        "GPS glitch 50 m",
        f"position 50 m aside for 1 s {_PUT}",
        rewriting(_OF_VELOCITIES, adding(x=50.0), 1.0),
        _MAY_END,
    ),
    Fault(
        "velocity jump 3 m/s",
        f"the velocity 3 m/s wrong for 1 s {_PUT}",
        rewriting(_OF_VELOCITIES, adding(vy=3.0), 1.0),
        _MAY_END,
    ),
)
