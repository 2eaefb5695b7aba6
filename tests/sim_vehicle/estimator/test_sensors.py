"""Aiding sensors: rates, noise, ranges, and what they look at."""

import math
import random

import numpy as np
import pytest
from pydantic import ValidationError

from sim_vehicle.airframe import load_built_in
from sim_vehicle.estimator.optics import distance_below
from sim_vehicle.estimator.samples import NO_QUALITY
from sim_vehicle.estimator.sensors import FlowSensor
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.world import build_world, plate
from tests.sim_vehicle.estimator.flying import filtered

INTERVAL_US = 4_000
SPECS = load_built_in("foldable").sensors
GROUND = build_world(()).faces


def body(north=0.0, down=-1.5, velocity=(0.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0), rates=(0.0, 0.0, 0.0)):
    return np.array([north, 0.0, down, *velocity, *attitude, *rates])


def flow_samples(state, seconds=1.0, **changes):
    spec = SPECS.optical_flow.model_copy(update=changes)
    sensor = FlowSensor(spec, INTERVAL_US, random.Random(1))
    times = range(INTERVAL_US, round(1e6 * seconds) + INTERVAL_US, INTERVAL_US)
    return [sample for time_us in times if (sample := sensor.observe(time_us, state, GROUND)) is not None]


def test_flow_is_speed_over_distance_and_turns_are_in_both_flow_and_gyroscope():
    # Given a vehicle 1.5 m up that flies forward at 3 m/s, right at 1.5 m/s and rolls right at 0.2 rad/s
    state = body(velocity=(3.0, 1.5, 0.0), rates=(0.2, 0.0, 0.1))
    samples = flow_samples(state, 60.0)[1:]
    flow = np.array([sample.flow_frd_rad for sample in samples]) / 0.1
    turn = np.array([sample.gyroscope_frd_rad for sample in samples]) / 0.1
    # Then the mean over a minute is v / d, with the roll on both
    spread = 4 * SPECS.optical_flow.noise_rad_s / math.sqrt(len(samples))
    assert flow.mean(axis=0) == pytest.approx([-1.0 + 0.2, 2.0], abs=spread)
    assert turn.mean(axis=0) == pytest.approx([0.2, 0.0, 0.1], abs=spread)
    # and the noise is as the file states it
    assert flow.std(axis=0) == pytest.approx(SPECS.optical_flow.noise_rad_s, rel=0.15)


@pytest.mark.parametrize(
    "state",
    [
        body(down=-0.05),
        body(down=-31.0),
        body(velocity=(13.0, 0.0, 0.0)),
        body(rates=(9.0, 0.0, 0.0)),
        body(attitude=(0.0, 1.0, 0.0, 0.0)),
    ],
    ids=["too near", "too far", "too fast", "turns too fast", "upside down"],
)
def test_flow_that_cannot_be_seen_has_no_quality(state):
    assert {sample.quality for sample in flow_samples(state)} == {NO_QUALITY}
    assert NO_QUALITY not in {sample.quality for sample in flow_samples(body())}


def distance(state, faces=GROUND) -> float:
    rotation = np.empty((3, 3))
    matrix_from_quaternion(state, rotation)
    return distance_below(state, rotation, faces)


def test_the_beam_meets_what_is_nearest_along_the_bodys_down_axis():
    # Given a roof 1 m up that reaches from 1 m north on, and a wall 3 m south of which the face looks north
    roof = plate("roof", (2.0, 0.0, -1.0), (0.0, 0.0, -1.0), (4.0, 2.0), 0.1)
    wall = plate("wall", (-3.0, 0.0, -1.5), (1.0, 0.0, 0.0), (4.0, 3.0), 0.1)
    faces = build_world((roof, wall)).faces
    # Then a level vehicle beside the roof sees the ground, above it the roof, below it the ground
    assert distance(body(north=0.5, down=-1.5), faces) == pytest.approx(1.5)
    assert distance(body(north=1.5, down=-1.5), faces) == pytest.approx(0.5)
    assert distance(body(north=1.5, down=-0.5), faces) == pytest.approx(0.5)
    # and one that lies on its back's edge, 60 degrees nose down, looks at the wall behind it
    nose_down = (math.cos(math.pi / 6), 0.0, -math.sin(math.pi / 6), 0.0)
    assert distance(body(north=-2.0, down=-1.5, attitude=nose_down), faces) == pytest.approx(1 / math.sin(math.pi / 3))
    assert distance(body(attitude=(0.0, 1.0, 0.0, 0.0))) == math.inf


@pytest.mark.parametrize("missing", ["optical_flow", "range_finder", "compass"])
def test_a_filter_without_the_sensors_it_needs_is_refused(missing):
    with pytest.raises(ValidationError, match="needs fitted sensors"):
        filtered(changes={"sensors": {missing: {"fitted": False}}})
    filtered(changes={"sensors": {missing: {"fitted": False}, "motion_capture": {"fitted": True}}})
