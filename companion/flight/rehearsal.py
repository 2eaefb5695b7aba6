"""One hit before the flight, on a core of its own, so that the flight's first one finds Python warm: what is loaded,
allocated and specialized at the first call is then.
"""

from collections.abc import Iterator
from typing import Any

from companion.autopilot.known import ASSUMED
from companion.flight.core import Core
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID, MULTICOPTERS
from companion.messages import (
    Attitude,
    AttitudeTarget,
    ExtendedState,
    Heartbeat,
    ImuSample,
    LandedState,
    LocalPosition,
    Outgoing,
    Sample,
)
from companion.motion.config import GRAVITY_M_S2
from companion.motion.strapdown import LEVEL
from companion.motion.vector import ZERO
from companion.reflex.config import MOST_HELD_S

# PX4's default of 50 Hz. Height and speed of the shipped missions; a hover's thrust.
INTERVAL_US, DOWN_M, NORTH_M_S, THRUST = 20_000, -1.5, 1.0, 0.5
# Samples: several of each stream until it is known that it flies; 0.8 s, SETTLED_US and THRUST_LEARNT_S, until hits
# are looked for and the thrust is known; a hit that has a second sample; some of its recovery.
MET, LEARNT, HIT, RECOVERING = 12, 40, 2, 10
# Above the largest threshold (StreamHealthConfig.max_threshold_m_s2).
HIT_M_S2 = -40.0
ACTIVE = 4  # MAV_STATE_ACTIVE


def rehearsed(core: Core[Any], flying: Any, custom_mode: int) -> Iterator[Outgoing]:
    """What a new core sends in the state `flying` to a vehicle that flies in that mode and is hit."""
    flight = core.flight
    for count in range(MET + LEARNT + HIT + RECOVERING):
        if count == MET:
            flight.origin_ned_m, flight.reflex.loss_s, core.state = ZERO, MOST_HELD_S, flying
            core.handler = core.handlers[flying](flight, core.now_us)
        is_hit = MET + LEARNT <= count < MET + LEARNT + HIT
        yield from core.advance(_samples(count, HIT_M_S2 if is_hit else 0.0, custom_mode), count * INTERVAL_US)[0]


def _samples(count: int, north_m_s2: float, custom_mode: int) -> list[Sample]:
    """With a little noise: an IMU that repeats itself is stuck."""
    us, noise = count * INTERVAL_US, 0.1 * (count % 3 - 1)
    imu = ImuSample(us, (north_m_s2, noise, noise - GRAVITY_M_S2), (0.1 * noise, 0.0, 0.0))
    if count % 2:
        return [imu]
    quadrotor, *_ = MULTICOPTERS
    return [
        imu,
        Heartbeat(1, AUTOPILOT_COMPONENT_ID, quadrotor, ASSUMED.mav_autopilot, True, custom_mode, ACTIVE),
        ExtendedState(LandedState.IN_AIR),
        LocalPosition(us, (1e-6 * us * NORTH_M_S, 0.0, DOWN_M), (NORTH_M_S, 0.0, 0.0)),
        Attitude(us, LEVEL, ZERO),
        AttitudeTarget(us, THRUST, LEVEL),
    ]
