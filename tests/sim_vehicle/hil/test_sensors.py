"""Sensors that PX4 gets: right in direction, unit and size."""

import math

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.messages import MOTORS_STOPPED, HilGps, HilSensor, MotionCapture
from sim_vehicle.hil.sensors import air_at, to_body
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.scene import Scene

LEVEL_NORTH = (1.0, 0.0, 0.0, 0.0)
HALF = math.sqrt(0.5)
NOSE_EAST = (HALF, 0.0, 0.0, HALF)
NOSE_UP = (HALF, 0.0, HALF, 0.0)
RIGHT_WING_DOWN = (HALF, HALF, 0.0, 0.0)

FOLDABLE = load_built_in("foldable")


def new_vehicle() -> HilVehicle:
    return HilVehicle(FOLDABLE, Scene(), seed=1, sample_interval_us=4_000)


def flown(vehicle: HilVehicle, seconds: float, motor_fraction: float) -> list:
    steps = round(seconds * 1e6 / vehicle.interval_us)
    return [message for _ in range(steps) for message in vehicle.step((motor_fraction,) * 4)]


def of_kind(messages: list, kind: type) -> list:
    return [message for message in messages if isinstance(message, kind)]


@pytest.mark.parametrize(
    ("attitude", "seen"),
    [
        (LEVEL_NORTH, (1, 2, 3)),
        (NOSE_EAST, (2, -1, 3)),  # the nose sees east, the right side looks south
        (NOSE_UP, (-3, 2, 1)),  # the nose looks up, the belly north
        (RIGHT_WING_DOWN, (1, 3, -2)),  # the right side sees down, the belly looks west
    ],
)
def test_a_vector_of_the_world_in_the_body(attitude, seen):
    assert to_body(attitude, (1.0, 2.0, 3.0)) == pytest.approx(seen)


def test_pressure_is_the_standard_atmospheres_and_falls_with_height():
    # ICAO 7488: 954.61 hPa at 500 m, 0.115 hPa less a metre there; 9 deg C at 924 m.
    assert air_at(500.0).pressure_hpa == pytest.approx(954.61, abs=0.05)
    assert air_at(500.0).pressure_hpa - air_at(501.0).pressure_hpa == pytest.approx(0.115, abs=0.002)
    assert air_at(924.0).temperature_c == pytest.approx(9.0, abs=0.1)
    assert air_at(500.0).altitude_m == pytest.approx(500.0)


def test_every_sensor_comes_at_its_rate_and_the_inertial_one_last():
    vehicle = new_vehicle()
    steps = [vehicle.step(MOTORS_STOPPED) for _ in range(250)]
    assert all(isinstance(messages[-1], HilSensor) for messages in steps)
    assert all(messages[-1].time_us == 4000 * (i + 1) for i, messages in enumerate(steps))
    everything = [message for messages in steps for message in messages]
    assert len(of_kind(everything, HilGps)) == 10
    assert len(of_kind(everything, MotionCapture)) == 50
    sensors = of_kind(everything, HilSensor)
    assert sum(sensor.magnetic_field_frd_gauss is not None for sensor in sensors) == 50
    assert sum(sensor.air is not None for sensor in sensors) == 50


def test_a_lost_gps_is_silent():
    scene = Scene.model_validate({"faults": [{"kind": "aiding_loss", "sensor": "gps", "at_s": 0.5}]})
    vehicle = HilVehicle(FOLDABLE, scene, seed=1, sample_interval_us=4_000)

    assert of_kind(flown(vehicle, 0.45, 0.0), HilGps)
    assert not of_kind(flown(vehicle, 1.0, 0.0)[50:], HilGps)
