"""Who steers: which offboard setpoints count, by place, attitude or rates, whose sticks, and how each is flown."""

import math

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.autopilot import offboard
from sim_vehicle.autopilot.commander.watching import ManualInput
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, DO_SET_MODE, RUN_PREARM_CHECKS
from sim_vehicle.autopilot.messages import AttitudeTarget, Result, StickInput
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.control.setpoint import AttitudeSetpoint, RatesSetpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.sim_vehicle.autopilot import kinematic_plant
from tests.sim_vehicle.autopilot.kinematic_plant import HOVER, Flight, hovering, in_offboard, set_mode, sticks, target
from tests.sim_vehicle.physics.throwing import flown

NORTH = kinematic_plant.attitude_of_yaw(0.0)
EAST = kinematic_plant.attitude_of_yaw(math.pi / 2)
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


def test_forward_with_the_nose_east_is_east_and_an_acceleration_turns_with_the_whole_attitude():
    setpoint = target(frame=8, velocity=(2.0, 0.0, 0.5))
    assert offboard.trajectory_setpoint(setpoint, NORTH).velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.5))
    assert offboard.trajectory_setpoint(setpoint, EAST).velocity_ned_m_s == pytest.approx((0.0, 2.0, 0.5))
    # Given the right wing down: the body's z axis points left of down, to the west with the nose north
    rolled = (math.cos(0.25), math.sin(0.25), 0.0, 0.0)
    setpoint = target(frame=8, acceleration_m_s2=(0.0, 0.0, 1.0))
    north, east, down = offboard.trajectory_setpoint(setpoint, rolled).acceleration_ned_m_s2
    assert (north, east, down) == pytest.approx((0.0, -math.sin(0.5), math.cos(0.5)))


@pytest.mark.parametrize("incomplete", [(None, None, -2.0), (1.0, None, -2.0)])
def test_what_leaves_an_axis_open_means_stop(incomplete):
    assert offboard.trajectory_setpoint(target(position=incomplete), NORTH) == offboard.STOP


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


LEVEL = (1.0, 0.0, 0.0, 0.0)
NO_RATES = (None, None, None)


@pytest.mark.parametrize(
    ("message", "flown"),
    [
        (AttitudeTarget(LEVEL, NO_RATES, 0.5), AttitudeSetpoint(LEVEL, 0.5)),
        (AttitudeTarget((2.0, 0.0, 0.0, 0.0), (None, None, 0.3), 0.5), AttitudeSetpoint(LEVEL, 0.5, 0.3)),
        # Both given: the attitude's own rates count
        (AttitudeTarget(LEVEL, (1.0, 2.0, 3.0), 0.5), AttitudeSetpoint(LEVEL, 0.5, 3.0)),
        (AttitudeTarget(None, (1.0, 2.0, None), 0.5), RatesSetpoint((1.0, 2.0, 0.0), 0.5)),
        (AttitudeTarget(None, (1.0, None, 3.0), 0.5), None),
        (AttitudeTarget(None, NO_RATES, 0.5), None),
        (AttitudeTarget((0.0, 0.0, 0.0, 0.0), NO_RATES, 0.5), None),
        (AttitudeTarget(LEVEL, NO_RATES, None), AttitudeSetpoint(LEVEL, 0.0)),
        (AttitudeTarget(LEVEL, NO_RATES, 7.0), AttitudeSetpoint(LEVEL, 1.0)),
    ],
)
def test_what_an_attitude_target_asks_for(message, flown):
    assert offboard.attitude_setpoint(message) == flown


def test_an_attitude_alone_arms_and_takes_off_without_the_ramp():
    flight = Flight()
    up = AttitudeTarget(LEVEL, NO_RATES, 1.2 * HOVER)
    flight.fly(0.2, up)
    set_mode(flight, Mode.OFFBOARD)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    flight.fly(1.0, up)
    assert flight.height_m == pytest.approx(0.5 * 0.2 * 9.81, abs=0.1)
    assert not flight.autopilot.detector.landed


@pytest.mark.parametrize("command", [None, RUN_PREARM_CHECKS])
def test_from_an_attitude_to_a_position_it_changes_with_the_commanders_status(command):
    # Given a vehicle that is flown by attitude
    flight = hovering(5.0)
    flight.fly(0.2, AttitudeTarget(LEVEL, NO_RATES, HOVER))
    set_mode(flight, Mode.OFFBOARD)
    flight.fly(1.0, AttitudeTarget(LEVEL, NO_RATES, HOVER))
    # When a position is asked for, alone or with any command
    flight.autopilot.receive(target(position_m=(1.0, 0.0, -5.0)))
    if command is not None:
        flight.ask(command)
    steps = 0
    while isinstance(flight.autopilot.applied, AttitudeSetpoint):
        flight.step()
        steps += 1
    # Then it is flown with the commander's status, which comes twice a second, or at once
    assert (steps * 0.004 <= 0.012) if command is not None else (0.1 < steps * 0.004 <= 0.51)


def thrown_up() -> tuple[Plant, float]:
    airframe = load_built_in("foldable")
    plant = Plant(airframe, Scene(), seed=1)
    plant.place((0.0, 0.0, -20.0), (0.0, 0.0, 0.0))
    flown(plant, TrajectorySetpoint((0.0, 0.0, -20.0)), 0.4)
    return plant, airframe.hover_fraction


def test_the_loops_lean_as_asked_and_accelerate_as_leaning_does():
    plant, hover = thrown_up()
    roll_rad = math.radians(15.0)
    asked = AttitudeSetpoint((math.cos(roll_rad / 2), math.sin(roll_rad / 2), 0.0, 0.0), hover / math.cos(roll_rad))
    output = flown(plant, asked, 1.0)[-1]
    assert math.degrees(2 * math.asin(output.attitude_wxyz[1])) == pytest.approx(15.0, abs=1.0)
    # Right wing down flies to the right, g tan 15 deg less what the first quarter of a second misses
    assert output.velocity_ned_m_s[1] == pytest.approx(9.81 * math.tan(roll_rad) * 0.8, abs=0.35)
    assert output.velocity_ned_m_s[2] == pytest.approx(0.0, abs=0.35)


def test_the_loops_turn_at_the_rates_asked_for():
    plant, hover = thrown_up()
    output = flown(plant, RatesSetpoint((0.8, -0.4, 0.5), hover), 0.24)[-1]
    assert output.angular_velocity_frd_rad_s == pytest.approx((0.8, -0.4, 0.5), abs=0.12)


FIRST, SECOND = 1, 2


def flying(mode: Mode, **parameters: float) -> Flight:
    """Taken off by the stick in POSCTL to some 5 m, then in ``mode`` with centred sticks."""
    flight = Flight(**parameters)
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
    flight = Flight()
    sticks(flight, 0.2, throttle=-1.0)
    assert set_mode(flight, Mode.STABILIZED) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    # Given COM_SPOOLUP_TIME, 1 s; then half of the throttle a second, however far the stick is up
    for more_s, thrust in ((0.9, 0.0), (0.6, 0.25), (0.5, 0.5), (1.2, 1.0)):
        sticks(flight, more_s, throttle=1.0)
        assert flight.autopilot.applied.thrust_fraction == pytest.approx(thrust, abs=0.02)
