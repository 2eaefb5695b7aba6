"""Whether whoever flies means the vehicle to go down."""

import pytest

from companion.autopilot.px4.firmware import PX4
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, AUTO_PRECLAND, OFFBOARD, POSCTL
from companion.guard.descent import Descent
from companion.link.vehicle import ModeReport, Vehicle
from companion.messages import LandedState, PositionTarget, Sticks
from companion.motion.config import SAME_M_S

SECOND = 1_000_000
ALTCTL, STABILIZED, MANUAL, ACRO = 2 << 16, 7 << 16, 1 << 16, 5 << 16


def is_meant(mode, *samples, now_us=0, landed=LandedState.IN_AIR):
    descent = Descent()
    descent.update(samples, 0)
    return descent.is_meant(Vehicle(mode=ModeReport(mode, None, False), landed=landed), now_us)


def down(speed_m_s):
    return PositionTarget((0.0, 0.0, -1.0), speed_m_s)


def throttle(deflection):
    return Sticks((0.0, 0.0, deflection, 0.0))


@pytest.mark.parametrize(
    ("mode", "samples", "is_so"),
    [
        # A landing mode, and a hand on the thrust
        *((mode, (), True) for mode in (AUTO_LAND, AUTO_PRECLAND, STABILIZED, MANUAL, ACRO)),
        # A pilot of whom nothing was ever heard may mean it
        *((mode, (), True) for mode in (ALTCTL, POSCTL)),
        (AUTO_LOITER, (), False),
        # A setpoint that sinks
        (OFFBOARD, (down(1.1 * SAME_M_S),), True),
        (OFFBOARD, (down(SAME_M_S),), False),
        (POSCTL, (down(None),), False),
        (AUTO_LOITER, (down(2.0), down(0.0)), False),
        # A throttle below its middle, where sticks ask for velocities
        (POSCTL, (throttle(-1.5 * PX4.defaults.stick_deadzone),), True),
        (ALTCTL, (throttle(-0.9 * PX4.defaults.stick_deadzone),), False),
        (AUTO_LOITER, (throttle(-1.0),), False),
    ],
)
def test_whoever_flies_means_what_lets_the_vehicle_down(mode, samples, is_so):
    assert is_meant(mode, *samples) is is_so


def test_a_setpoint_counts_while_it_is_renewed_and_a_vehicle_that_says_it_lands_is_meant_to():
    # PX4 keeps a setpoint for COM_OF_LOSS_T, 1 s
    assert is_meant(OFFBOARD, down(2.0), now_us=SECOND - 1) and not is_meant(OFFBOARD, down(2.0), now_us=SECOND)
    assert is_meant(AUTO_LOITER, landed=LandedState.LANDING)
