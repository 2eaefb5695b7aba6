"""PX4's parameters for our airframes: geometry, hover and loops, against the physics they are for."""

import math

import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.hil.messages import HilSensor
from sim_vehicle.hil.parameters import Position, px4_parameters
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import quiet

FOLDABLE = load_built_in("foldable")


def values(airframe: Airframe = FOLDABLE, position: Position = "mocap") -> dict[str, float]:
    return {parameter.name: parameter.value for parameter in px4_parameters(airframe, position)}


def test_a_unit_of_roll_torque_turns_as_fast_as_the_gains_assume():
    """A roll torque setpoint s moves each motor by s / sqrt(2); P times the acceleration of s = 1 is the loop."""
    vehicle = HilVehicle(quiet(FOLDABLE), Scene(), 1, sample_interval_us=4_000)
    hover, part = values()["MPC_THR_HOVER"], 0.01
    for _ in range(150):
        vehicle.step((0.95,) * 4)
    offset = part / math.sqrt(2)
    rates = []
    for _ in range(40):
        messages = vehicle.step((hover - offset, hover + offset, hover + offset, hover - offset))
        rates += [(m.time_us, m.angular_velocity_frd_rad_s[0]) for m in messages if isinstance(m, HilSensor)]
    (t0, p0), (t1, p1) = rates[-6], rates[-1]
    per_unit = (p1 - p0) / (1e-6 * (t1 - t0)) / part
    loop_per_s = 2 * FOLDABLE.control.attitude_damping * FOLDABLE.control.attitude_frequency_rad_s
    assert values()["MC_ROLLRATE_P"] * per_unit == pytest.approx(loop_per_s, rel=0.05)
