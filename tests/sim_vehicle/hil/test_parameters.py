"""PX4's parameters for our airframes: geometry, hover and loops, against the physics they are for."""

import math

import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.hil.messages import HilState
from sim_vehicle.hil.parameters import Position, as_airframe_file, as_environment, as_params_file, px4_parameters
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.scene import Scene

FOLDABLE = load_built_in("foldable")


def values(airframe: Airframe = FOLDABLE, position: Position = "mocap") -> dict[str, float]:
    return {parameter.name: parameter.value for parameter in px4_parameters(airframe, position)}


def test_rotors_stand_where_the_airframe_has_them():
    found = values()
    corners = [
        (math.copysign(1, found[f"CA_ROTOR{i}_PX"]), math.copysign(1, found[f"CA_ROTOR{i}_PY"])) for i in range(4)
    ]
    assert corners == [(1, 1), (-1, -1), (1, -1), (-1, 1)]
    for i in range(4):
        assert math.hypot(found[f"CA_ROTOR{i}_PX"], found[f"CA_ROTOR{i}_PY"]) == pytest.approx(0.145)
    assert [found[f"CA_ROTOR{i}_KM"] for i in range(4)] == pytest.approx([0.016, 0.016, -0.016, -0.016])
    assert [found[f"PWM_MAIN_FUNC{i}"] for i in range(1, 5)] == [101, 102, 103, 104]


def test_the_hover_thrust_neither_climbs_nor_sinks():
    vehicle = HilVehicle(FOLDABLE, Scene(), 1, sample_interval_us=4_000)
    for _ in range(150):
        vehicle.step((0.95,) * 4)
    speeds = []
    for _ in range(100):
        messages = vehicle.step((values()["MPC_THR_HOVER"],) * 4)
        speeds += [m.velocity_ned_m_s[2] for m in messages if isinstance(m, HilState)]
    # Drag alone slows the climb of 0.6 m/s, by 8 % in the last 0.3 s.
    assert speeds[-1] == pytest.approx(speeds[10], rel=0.15)


def test_a_unit_of_roll_torque_turns_as_fast_as_the_gains_assume():
    """A roll torque setpoint s moves each motor by s / sqrt(2); P times the acceleration of s = 1 is the loop."""
    vehicle = HilVehicle(FOLDABLE, Scene(), 1, sample_interval_us=4_000)
    hover, part = values()["MPC_THR_HOVER"], 0.01
    for _ in range(150):
        vehicle.step((0.95,) * 4)
    offset = part / math.sqrt(2)
    rates = []
    for _ in range(40):
        messages = vehicle.step((hover - offset, hover + offset, hover + offset, hover - offset))
        rates += [(m.time_us, m.angular_velocity_frd_rad_s[0]) for m in messages if isinstance(m, HilState)]
    (t0, p0), (t1, p1) = rates[-6], rates[-1]
    per_unit = (p1 - p0) / (1e-6 * (t1 - t0)) / part
    loop_per_s = 2 * FOLDABLE.control.attitude_damping * FOLDABLE.control.attitude_frequency_rad_s
    assert values()["MC_ROLLRATE_P"] * per_unit == pytest.approx(loop_per_s, rel=0.05)


def test_a_tipped_vehicle_is_turned_back_by_all_that_the_built_in_loop_asks_for_at_most():
    """P_rate * (MC_*RATE_MAX) is eq. 5's k_R e_R at a right angle, w^2; and with little thrust as well."""
    found, control = values(), FOLDABLE.control
    loop_per_s = 2 * control.attitude_damping * control.attitude_frequency_rad_s
    assert loop_per_s * math.radians(found["MC_PITCHRATE_MAX"]) == pytest.approx(control.attitude_frequency_rad_s**2)
    assert found["MC_AIRMODE"] == 1


def test_every_format_has_every_parameter():
    environment, params, airframe = as_environment(FOLDABLE), as_params_file(FOLDABLE), as_airframe_file(FOLDABLE)
    for parameter in px4_parameters(FOLDABLE):
        assert f"export PX4_PARAM_{parameter.name}={parameter.text}  #" in environment
        kind = 6 if isinstance(parameter.value, int) else 9
        assert f"1\t1\t{parameter.name}\t{parameter.text}\t{kind}" in params
        assert f"param set-default {parameter.name} {parameter.text}" in airframe
