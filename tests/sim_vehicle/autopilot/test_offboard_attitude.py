"""Offboard by attitude and by rates."""

import math

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.autopilot import offboard
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, RUN_PREARM_CHECKS
from sim_vehicle.autopilot.messages import AttitudeTarget, Result
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.control.setpoint import AttitudeSetpoint, RatesSetpoint, TrajectorySetpoint
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.sim_vehicle.autopilot.flying import hovering, set_mode
from tests.sim_vehicle.autopilot.kinematic_plant import HOVER, Flight, target

LEVEL = (1.0, 0.0, 0.0, 0.0)
NO_RATES = (None, None, None)


def leaning(roll_deg: float) -> tuple[float, float, float, float]:
    half = math.radians(roll_deg) / 2
    return math.cos(half), math.sin(half), 0.0, 0.0


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
    for _ in range(100):
        plant.step(TrajectorySetpoint((0.0, 0.0, -20.0)), armed=True)
    return plant, airframe.hover_fraction


def test_the_loops_lean_as_asked_and_accelerate_as_leaning_does():
    plant, hover = thrown_up()
    asked = AttitudeSetpoint(leaning(15.0), hover / math.cos(math.radians(15.0)))
    for _ in range(250):
        output = plant.step(asked, armed=True)
    assert math.degrees(2 * math.asin(output.attitude_wxyz[1])) == pytest.approx(15.0, abs=1.0)
    # Right wing down flies to the right, g tan 15 deg less what the first quarter of a second misses
    assert output.velocity_ned_m_s[1] == pytest.approx(9.81 * math.tan(math.radians(15.0)) * 0.8, abs=0.35)
    assert output.velocity_ned_m_s[2] == pytest.approx(0.0, abs=0.35)


def test_the_loops_turn_at_the_rates_asked_for():
    plant, hover = thrown_up()
    for _ in range(60):
        output = plant.step(RatesSetpoint((0.8, -0.4, 0.5), hover), armed=True)
    assert output.angular_velocity_frd_rad_s == pytest.approx((0.8, -0.4, 0.5), abs=0.12)
