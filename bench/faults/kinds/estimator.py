"""Estimates that jump, drift, or are led astray."""

import math
import random
from collections.abc import Callable

from bench.faults.air import Injector, When
from bench.faults.fault import COMPLETED, HANDED_OVER, Expected, Fault
from bench.faults.injectors import Rewritten, Simulated, adding
from bench.faults.packets import ODOMETRY, POSITION
from sim_vehicle.bench.faults import ekf_reset, gps_loss, other

_MAY_END = Expected((COMPLETED, HANDED_OVER), finds=False)


def _reset(position_m: float, velocity_m_s: float) -> Callable[[random.Random], Injector]:
    """Sideways from any side."""

    def make(chance: random.Random) -> Injector:
        north, east = (f(chance.uniform(-math.pi, math.pi)) for f in (math.cos, math.sin))
        jump, hop = (position_m * north, position_m * east, 0.0), (velocity_m_s * north, velocity_m_s * east, 0.0)
        return Simulated(ekf_reset(jump, hop), When.flying(chance))

    return make


FAULTS = (
    Fault("position reset 3 m", "estimator", "the estimate jumps sideways and says so", _reset(3.0, 0.0), _MAY_END),
    Fault(
        "velocity reset 1 m/s",
        "estimator",
        "the estimated velocity jumps and says so, and finds back",
        _reset(0.0, 1.0),
        Expected(finds=False),
    ),
    Fault(
        "height reset 0.5 m",
        "estimator",
        "the estimated height jumps and says so",
        lambda c: Simulated(ekf_reset((0.0, 0.0, c.choice((-0.5, 0.5)))), When.flying(c)),
        _MAY_END,
    ),
    Fault(
        "resets after clipping",
        "estimator",
        "four velocity resets of 0.3 m/s within 36 ms of a hit that clipped",
        lambda c: Simulated(other("estimator_after_clipping"), When.flying(c)),
    ),
    Fault(
        "GPS lost",
        "estimator",
        "no fix from the cruise on; the velocity drifts",
        lambda c: Simulated(gps_loss(), When.flying(c)),
        _MAY_END,
    ),
    Fault(
        "GPS glitch 50 m",
        "estimator",
        "position 50 m aside for 1 s in what the companion hears",
        lambda c: Rewritten(When.flying(c, 1.0), (POSITION, ODOMETRY), adding(x=50.0)),
        _MAY_END,
    ),
    Fault(
        "velocity jump 3 m/s",
        "estimator",
        "the velocity 3 m/s wrong for 1 s in what the companion hears",
        lambda c: Rewritten(When.flying(c, 1.0), (POSITION, ODOMETRY), adding(vy=3.0)),
        _MAY_END,
    ),
)
