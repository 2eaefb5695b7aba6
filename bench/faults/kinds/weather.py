"""Wind, and what befalls the body."""

import math
import random

from bench.faults.air import Injector, When
from bench.faults.fault import COMPLETED, HANDED_OVER, Expected, Fault
from bench.faults.injectors import Simulated
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


FAULTS = (
    Fault("gust", "wind and body", f"4 to 8 m/s within 0.3 s, for 2 s, {_ANY_SIDE}", _gust, Expected(finds=False)),
    Fault(
        "turbulence",
        "wind and body",
        "Dryden's, moderate: 15.4 m/s at 20 ft",
        lambda c: Simulated(other("turbulence", wind_20ft_m_s=15.4), When("connect")),
        Expected(finds=False),
        from_the_start=True,
    ),
    Fault(
        "push",
        "wind and body",
        f"2 N for 0.5 s, {_ANY_SIDE}: a hand, which may count as a hit",
        _push,
        Expected((COMPLETED, HANDED_OVER), finds=False, false_hits=1),
    ),
    Fault(
        "payload drop",
        "wind and body",
        "100 g fall off",
        lambda c: Simulated(other("payload_drop", mass_kg=0.1), When.flying(c)),
        Expected(finds=False),
    ),
    Fault(
        "bent propeller",
        "wind and body",
        "vibration of 10 m/s2 rms from one sample to the next, from the cruise on; its onset may count as a hit",
        lambda c: Simulated(other("vibration", accelerometer_rms_m_s2=10.0, motor=0), When.flying(c)),
        Expected((COMPLETED, HANDED_OVER), finds=False, false_hits=1),
    ),
    Fault(
        "battery sags",
        "wind and body",
        "5 % of the voltage from the cruise on",
        lambda c: Simulated(other("battery_sag", voltage_share=0.95), When.flying(c, 30.0)),
        Expected(finds=False),
    ),
)
