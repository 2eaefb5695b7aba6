"""Wind, and what befalls the body."""

import math
import random

from bench.faults.injectors import Simulated, flying
from bench.fly.air import COMPLETED, HANDED_OVER, Expected, Fault, Injector, When
from sim_vehicle.bench.faults import other

_ANY_SIDE = "from any side"


def _gust(chance: random.Random) -> Injector:
    side, speed = chance.uniform(-math.pi, math.pi), chance.uniform(4.0, 8.0)
    wind = (speed * math.cos(side), speed * math.sin(side), 0.0)
    return Simulated(other("gust", velocity_ned_m_s=wind, rise_s=0.3), When.flying(chance, 2.0))


def _push(chance: random.Random) -> Injector:
    side = chance.uniform(-math.pi, math.pi)
    force = (2.0 * math.cos(side), 2.0 * math.sin(side), 0.0)
    return Simulated(other("push", force_ned_n=force), When.flying(chance, 0.5))


_GUST = f"4 to 8 m/s within 0.3 s, for 2 s, {_ANY_SIDE}"
_PUSH = f"2 N for 0.5 s, {_ANY_SIDE}: a hand, which may count as a hit"
_BENT = "vibration of 10 m/s2 rms from one sample to the next, from the cruise on; its onset may count as a hit"
_MAY_MISS = Expected(finds=False)
_MAY_COUNT = Expected((COMPLETED, HANDED_OVER), finds=False, false_hits=1)

FAULTS = (
    Fault("gust", _GUST, _gust, _MAY_MISS),
    Fault(
        "turbulence",
        "Dryden's, moderate: 15.4 m/s at 20 ft",
        lambda c: Simulated(other("turbulence", wind_20ft_m_s=15.4), When("connect")),
        _MAY_MISS,
        from_the_start=True,
    ),
    Fault("push", _PUSH, _push, _MAY_COUNT),
    Fault("payload drop", "100 g fall off", flying(other("payload_drop", mass_kg=0.1)), _MAY_MISS),
    Fault("bent propeller", _BENT, flying(other("vibration", accelerometer_rms_m_s2=10.0, motor=0)), _MAY_COUNT),
    Fault(
        "battery sags",
        "5 % of the voltage from the cruise on",
        flying(other("battery_sag", voltage_share=0.95), 30.0),
        _MAY_MISS,
    ),
)
