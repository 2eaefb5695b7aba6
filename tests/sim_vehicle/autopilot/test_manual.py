"""Sticks: whose count, and how they fly each mode."""

import math

import pytest

from sim_vehicle.autopilot.commander.watching import ManualInput
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM
from sim_vehicle.autopilot.messages import Result, StickInput
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.flying import set_mode, sticks
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

FIRST, SECOND = 1, 2


def flying(mode: Mode, **parameters: float) -> Flight:
    """Taken off by the stick in POSCTL to some 5 m, then in ``mode`` with centred sticks."""
    flight = Flight(None, **parameters)
    sticks(flight, 0.2, throttle=-1.0)
    assert flight.autopilot.modes.flown is Mode.POSCTL
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    sticks(flight, 1.5)
    assert flight.height_m == 0.0
    for _ in range(40):
        sticks(flight, 0.25, throttle=0.8)
        if flight.height_m > 5.0:
            break
    sticks(flight, 4.0)
    if mode is not Mode.POSCTL:
        assert set_mode(flight, mode) is Result.ACCEPTED
    sticks(flight, 0.1)
    return flight


def test_the_first_that_comes_counts_until_it_is_lost():
    manual = ManualInput(Parameters({"COM_RC_LOSS_T": 0.5}))
    manual.heard(StickInput(0, 0, 0, 0, FIRST), 0)
    manual.heard(StickInput(0, 0, 0, 0, SECOND), 20_000)
    # Looked for every 200 ms: COM_RC_LOSS_T is over after 500, which shows after 600
    manual.update(599_000)
    assert manual.sticks.source == FIRST
    manual.update(600_000)
    assert manual.sticks is None
    manual.heard(StickInput(0, 0, 0, 0, SECOND), 610_000)
    assert manual.sticks.source == SECOND


def test_only_a_stick_that_is_moved_fast_enough_counts_as_moved():
    # COM_RC_STICK_OV is 30 % a second
    for speed, moved in ((0.2, False), (0.5, True)):
        manual = ManualInput(Parameters({"COM_RC_IN_MODE": 1}))
        for number in range(50):
            manual.heard(StickInput(0.02 * speed * number, 0, 0, 0, FIRST), 20_000 * number)
        assert manual.moving is moved


@pytest.mark.parametrize(
    ("held", "north", "east"),
    [({"pitch": 1.0}, 1, 0), ({"pitch": -1.0}, -1, 0), ({"roll": 1.0}, 0, 1), ({"roll": -1.0}, 0, -1)],
)
def test_a_full_stick_flies_at_mpc_vel_manual_and_brakes_when_let_go(held, north, east):
    flight = flying(Mode.POSCTL, MPC_VEL_MANUAL=6.0)
    sticks(flight, 12.0, **held)
    v_north, v_east, _ = flight.state.velocity_ned_m_s
    assert (v_north, v_east) == pytest.approx((6.0 * north, 6.0 * east), abs=0.3)
    sticks(flight, 5.0)
    assert math.hypot(*flight.state.velocity_ned_m_s) < 0.05


def test_forward_is_where_the_nose_points():
    flight = flying(Mode.POSCTL)
    sticks(flight, 2.0, yaw=0.5)
    sticks(flight, 1.0)
    yaw_rad = yaw_of(flight.state.attitude_wxyz)
    sticks(flight, 4.0, pitch=0.6)
    v_north, v_east, _ = flight.state.velocity_ned_m_s
    assert math.atan2(v_east, v_north) == pytest.approx(yaw_rad, abs=0.1)


@pytest.mark.parametrize("mode", [Mode.POSCTL, Mode.ALTCTL])
def test_the_throttle_is_a_climb_and_centred_it_holds_the_height(mode):
    flight = flying(mode)
    before_m = flight.height_m
    sticks(flight, 3.0, throttle=1.0)
    assert -flight.state.velocity_ned_m_s[2] == pytest.approx(flight.parameters["MPC_Z_VEL_MAX_UP"], abs=0.2)
    sticks(flight, 4.0)
    held_m = flight.height_m
    assert held_m > before_m + 5.0
    sticks(flight, 5.0)
    assert flight.height_m == pytest.approx(held_m, abs=0.05)


def test_in_altitude_mode_the_stick_leans_the_vehicle():
    flight = flying(Mode.ALTCTL)
    sticks(flight, 0.3, roll=0.5)
    asked = flight.autopilot.applied
    assert asked.acceleration_ned_m_s2[1] == pytest.approx(9.80665 * math.tan(math.radians(35.0)) * 0.5)
    assert asked.position_ned_m[:2] == (None, None)


def test_stabilised_sticks_are_angles_and_thrust():
    flight = flying(Mode.STABILIZED)
    sticks(flight, 0.1, roll=1.0)
    asked = flight.autopilot.applied
    w, x, y, z = asked.attitude_wxyz
    assert math.degrees(2 * math.atan2(x, w)) == pytest.approx(35.0, abs=0.1)
    assert (y, z) == pytest.approx((0.0, 0.0), abs=1e-6)
    # Hover thrust with the stick in the middle, all and next to nothing at its ends
    for stick, thrust in ((0.0, 0.5), (1.0, 1.0), (-1.0, 0.08)):
        sticks(flight, 0.1, throttle=stick)
        assert flight.autopilot.applied.thrust_fraction == pytest.approx(thrust)


def test_after_arming_the_throttle_waits_for_the_motors_and_then_rises_slowly():
    flight = Flight(None)
    sticks(flight, 0.2, throttle=-1.0)
    assert set_mode(flight, Mode.STABILIZED) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    # Given COM_SPOOLUP_TIME, 1 s; then half of the throttle a second, however far the stick is up
    for more_s, thrust in ((0.9, 0.0), (0.6, 0.25), (0.5, 0.5), (1.2, 1.0)):
        sticks(flight, more_s, throttle=1.0)
        assert flight.autopilot.applied.thrust_fraction == pytest.approx(thrust, abs=0.02)
