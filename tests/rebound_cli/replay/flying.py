"""A made-up flight as a log: what a detector would hear of it."""

from pathlib import Path

import numpy as np

from bench.detectors.config import BaselineConfig
from companion.autopilot.px4.modes import OFFBOARD
from companion.messages import ExtendedState, Heartbeat, ImuSample, LandedState, LocalPosition
from rebound_cli.logs.log import Log, LoggedSample

LATERAL = BaselineConfig(detector="lateral")
SECOND = 1_000_000
HIT_US = 6 * SECOND


def beat(armed, mode=OFFBOARD):
    return Heartbeat(1, 1, 2, 12, armed, mode, 4 if armed else 3)


def position(time_us, height_m, speed_m_s=0.0):
    return LocalPosition(time_us, (0.0, 0.0, -height_m), (speed_m_s, 0.0, 0.0))


def flight(hit_us=HIT_US, gap=None, push_m_s2=40.0):
    """Ten seconds: armed at 1 s, in the air from 2 s on, 1 m/s north; a push from ahead at `hit_us`, for 24 ms."""
    noise = np.random.default_rng(1).normal(0.0, 0.3, (2500, 3))
    heard = [
        LoggedSample(0, beat(False)),
        LoggedSample(0, ExtendedState(LandedState.ON_GROUND)),
        LoggedSample(SECOND, beat(True)),
        LoggedSample(2 * SECOND, ExtendedState(LandedState.IN_AIR)),
    ]
    for index, (x, y, z) in enumerate(noise.tolist()):
        time_us = index * 4000
        if gap is not None and gap[0] <= time_us < gap[1]:
            continue
        push = -push_m_s2 if hit_us is not None and hit_us < time_us <= hit_us + 24_000 else 0.0
        heard.append(LoggedSample(time_us, ImuSample(time_us, (x + push, y, -9.8 + z), (0.0, 0.0, 0.0))))
        if time_us % 20_000 == 0:
            heard.append(LoggedSample(time_us, position(time_us, 1.5 if time_us > 2 * SECOND else 0.0, 1.0)))
    heard.sort(key=lambda item: item.at_us)
    return Log(Path("flight.tlog"), "PX4", 0, tuple(heard), ())
