"""Whether whoever flies means the vehicle to go down."""

import pytest

from companion.guard.descent import STICK_DEADZONE, Descent
from companion.link.vehicle import ModeReport, Vehicle
from companion.messages import LandedState, PositionTarget, Sticks
from companion.motion.config import SAME_M_S
from companion.px4_mode import AUTO_LAND, AUTO_LOITER, AUTO_PRECLAND, OFFBOARD, POSCTL

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


@pytest.mark.parametrize("mode", [AUTO_LAND, AUTO_PRECLAND, STABILIZED, MANUAL, ACRO])
def test_a_landing_mode_and_a_hand_on_the_thrust_mean_what_lets_the_vehicle_down(mode):
    assert is_meant(mode)


def test_a_vehicle_that_says_it_lands_is_meant_to():
    assert is_meant(AUTO_LOITER, landed=LandedState.LANDING) and not is_meant(AUTO_LOITER)


@pytest.mark.parametrize("mode", [AUTO_LOITER, OFFBOARD, POSCTL])
def test_a_setpoint_that_sinks_means_it_while_it_is_renewed(mode):
    assert is_meant(mode, down(1.1 * SAME_M_S)) and not is_meant(mode, down(SAME_M_S))
    assert not is_meant(mode, down(None)) and not is_meant(mode, down(2.0), down(0.0))
    # PX4 keeps a setpoint for COM_OF_LOSS_T, 1 s
    assert is_meant(mode, down(2.0), now_us=SECOND - 1) and not is_meant(mode, down(2.0), now_us=SECOND)


@pytest.mark.parametrize("mode", [ALTCTL, POSCTL])
def test_a_pilot_of_whom_nothing_was_ever_heard_may_mean_it(mode):
    assert is_meant(mode) and not is_meant(AUTO_LOITER)


@pytest.mark.parametrize("mode", [ALTCTL, POSCTL])
def test_a_throttle_below_its_middle_means_it_where_sticks_ask_for_velocities(mode):
    assert is_meant(mode, throttle(-1.5 * STICK_DEADZONE)) and not is_meant(mode, throttle(-0.9 * STICK_DEADZONE))
    assert not is_meant(AUTO_LOITER, throttle(-1.0))
