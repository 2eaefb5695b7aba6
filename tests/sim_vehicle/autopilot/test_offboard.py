"""Which offboard setpoints count, and how the vehicle flies when they stop and come back."""

import math

import pytest

from sim_vehicle.autopilot import offboard
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, DO_SET_MODE
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.control.setpoint import FREE
from tests.sim_vehicle.autopilot.flying import in_offboard
from tests.sim_vehicle.autopilot.kinematic_plant import Flight, attitude_of_yaw, target

NORTH = attitude_of_yaw(0.0)
EAST = attitude_of_yaw(math.pi / 2)
UP_THERE = target(position=(0.0, 0.0, -5.0))


@pytest.mark.parametrize(
    ("setpoint", "why"),
    [
        (target(position=(1.0, 2.0, 3.0)), None),
        (target(velocity=(1.0, 2.0, 3.0)), None),
        (target(position=(None, None, -2.0)), None),
        (target(acceleration_m_s2=(0.0, 0.0, 1.0)), None),
        (target(frame=8, velocity=(1.0, 0.0, 0.0)), None),
        (target(), "SET_POSITION_TARGET_LOCAL_NED invalid"),
        (target(frame=8, position=(1.0, 0.0, 0.0)), "SET_POSITION_TARGET_LOCAL_NED invalid"),
        (target(frame=8, velocity=(1.0, None, 0.0)), "SET_POSITION_TARGET_LOCAL_NED invalid"),
        (target(acceleration_m_s2=(0.0, 0.0, 1.0), is_force=True), "SET_POSITION_TARGET_LOCAL_NED force not supported"),
        *((target(frame=frame, position=(1, 0, 0)), f"coordinate frame {frame} unsupported") for frame in (0, 7, 9)),
    ],
)
def test_what_is_refused_and_in_which_words(setpoint, why):
    refusal = offboard.refusal(setpoint)
    assert (refusal is None) is (why is None) and (why or "") in (refusal.text if refusal else "")


def test_forward_with_the_nose_east_is_east():
    setpoint = target(frame=8, velocity=(2.0, 0.0, 0.5))
    assert offboard.trajectory_setpoint(setpoint, NORTH).velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.5))
    assert offboard.trajectory_setpoint(setpoint, EAST).velocity_ned_m_s == pytest.approx((0.0, 2.0, 0.5))


def test_a_body_acceleration_turns_with_the_whole_attitude():
    # Given the right wing down: the body's z axis points left of down, to the west with the nose north
    rolled = (math.cos(0.25), math.sin(0.25), 0.0, 0.0)
    setpoint = target(frame=8, acceleration_m_s2=(0.0, 0.0, 1.0))
    north, east, down = offboard.trajectory_setpoint(setpoint, rolled).acceleration_ned_m_s2
    assert (north, east, down) == pytest.approx((0.0, -math.sin(0.5), math.cos(0.5)))


@pytest.mark.parametrize("incomplete", [(None, None, -2.0), (1.0, None, -2.0)])
def test_a_setpoint_that_leaves_an_axis_open_means_stop(incomplete):
    flown = offboard.trajectory_setpoint(target(position=incomplete), NORTH)
    assert flown.position_ned_m == FREE
    assert flown.velocity_ned_m_s == (0.0, 0.0, 0.0)


def test_without_setpoints_offboard_can_be_chosen_but_not_armed():
    flight = Flight()
    assert flight.ask(DO_SET_MODE, 1, 6) is Result.ACCEPTED
    assert flight.autopilot.commander.system_status == 0
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED
    assert flight.autopilot.texts[-1].text == "Arming denied: Resolve system health failures first"
    # And with them, it can
    flight.fly(0.5, UP_THERE)
    assert flight.autopilot.commander.system_status == 3
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED


def test_setpoints_that_come_back_put_it_into_offboard_again():
    flight = in_offboard(UP_THERE)
    flight.fly_until(lambda: flight.autopilot.commander.failsafe.acts, 2.0)
    flight.fly(0.5)
    waited_s = flight.fly_until(lambda: flight.autopilot.modes.flown is Mode.OFFBOARD, 0.5, UP_THERE)
    assert waited_s == pytest.approx(0.09, abs=0.01)
    flight.fly(3.0, UP_THERE)
    assert flight.height_m == pytest.approx(5.0, abs=0.05)
    assert flight.autopilot.commander.system_status == 4


def test_a_refused_frame_and_an_empty_mask_do_not_keep_it_alive():
    for useless in (target((0, 0, -5.0), frame=9), target()):
        flight = in_offboard(UP_THERE)
        flight.fly_until(lambda flight=flight: flight.autopilot.commander.failsafe.acts, 2.0, useless)


def test_only_setpoints_received_in_offboard_are_flown():
    # Given setpoints streamed while another mode flies
    flight = in_offboard(UP_THERE)
    flight.ask(DO_SET_MODE, 1, 4, 3)
    flight.fly(2.0, target(position=(50.0, 0.0, -5.0)))
    # When OFFBOARD is entered and no further setpoint comes
    flight.ask(DO_SET_MODE, 1, 6)
    flight.fly(0.9)
    # Then the vehicle stays
    assert flight.autopilot.modes.flown is Mode.OFFBOARD
    assert abs(flight.state.position_ned_m[0]) < 0.1
