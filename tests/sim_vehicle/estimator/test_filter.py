"""The filter: its model, its aiding sensors, as good in flight as it says, and led astray by a hit that clips."""

import math
import random

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2

from sim_vehicle.airframe import load_built_in
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.estimator import strapdown
from sim_vehicle.estimator.optics import distance_below
from sim_vehicle.estimator.sensors import FlowSensor
from sim_vehicle.estimator.strapdown import (
    ERROR_ROWS,
    QUATERNION,
    SAMPLE_COLUMNS,
    VELOCITY,
    advance,
    down_range,
    heading,
)
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.physics.record import new_record
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.world import build_world, plate
from tests.sim_vehicle.estimator.flying import HOVER, WITH_CAMERAS, Flight, circle, filtered, hit_wall

STEP_S = 0.004
NOISE = np.array([1e-5, 1e-3, 1e-6, 1e-6, 0.1])


def tilted() -> np.ndarray:
    """Some state in flight, none of whose entries is special."""
    place, velocity, biases = [1.0, -2.0, -1.7], [1.5, -0.7, 0.3], [0.002, -0.001, 0.003, 0.05, -0.03, 0.02]
    attitude = np.array([0.95, 0.12, -0.17, 0.21])
    return np.concatenate([place, velocity, attitude / np.linalg.norm(attitude), biases, [0.01, -0.02]])


def some_sample() -> np.ndarray:
    sample = np.zeros(SAMPLE_COLUMNS)
    sample[0:6] = [1.2, -0.8, -11.0, 0.6, -0.9, 0.4]
    return sample


def advanced(nominal: np.ndarray, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    after, f, q = nominal.copy(), np.eye(ERROR_ROWS), np.zeros((ERROR_ROWS, ERROR_ROWS))
    advance(after, sample, STEP_S, NOISE, f, q)
    return after, f, q


def erred(nominal: np.ndarray, row: int, size: float) -> np.ndarray:
    """The state that is ``size`` of one error away."""
    error = np.zeros(ERROR_ROWS)
    error[row] = size
    moved = nominal.copy()
    strapdown.correct(moved, error)
    return moved


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The error that leads from ``b`` to ``a``."""
    conjugate = b[6:10] * [1, -1, -1, -1]
    w, x, y, z = conjugate
    p, q, r, s = a[6:10]
    turn = 2 * np.array([w * q + x * p + y * s - z * r, w * r - x * s + y * p + z * q, w * s + x * r - y * q + z * p])
    return np.concatenate([turn, a[3:6] - b[3:6], a[0:3] - b[0:3], a[10:] - b[10:]])


@pytest.mark.parametrize("row", range(ERROR_ROWS))
def test_the_transition_is_the_derivative_of_the_motion(row: int) -> None:
    size = 1e-5
    plus, minus = (advanced(erred(tilted(), row, sign * size), some_sample())[0] for sign in (1, -1))
    _, f, _ = advanced(tilted(), some_sample())
    # F is of first order in the step of 4 ms: what it leaves out is of second order.
    assert difference(plus, minus) / (2 * size) == pytest.approx(f[:, row], abs=2e-4)


@pytest.mark.parametrize("measure", [down_range, heading])
def test_each_measurements_row_is_its_derivative(measure) -> None:
    row, unused = np.empty(ERROR_ROWS), np.empty(ERROR_ROWS)
    measure(tilted(), row)
    for column in range(ERROR_ROWS):
        plus, minus = (measure(erred(tilted(), column, sign * 1e-6), unused) for sign in (1, -1))
        assert (plus - minus) / 2e-6 == pytest.approx(row[column], abs=1e-6)


def output_beside_the_filter(samples, corrections=()):
    """The output's state after each sample, of a filter three samples behind that is corrected before some of them."""
    nominal = np.zeros(strapdown.NOMINAL_ROWS)
    nominal[QUATERNION] = 1.0
    output = new_record(strapdown.Output, now=[*nominal, 0.0, 0.0, 0.0])
    past, ring, shown = np.tile(nominal[:10], (4, 1)), np.zeros((4, SAMPLE_COLUMNS)), []
    ring[:, 2] = -GRAVITY_M_S2
    for step, sample in enumerate(samples):
        ring[step % 4] = sample
        oldest = (step + 1) % 4
        nominal = advanced(nominal, ring[oldest])[0]
        for row, change in dict(corrections).get(step, {}).items():
            nominal[row] += change
        strapdown.follow(nominal, ring, past, oldest, STEP_S, output)
        shown.append(output.now[:10].copy())
    return np.array(shown)


def test_the_output_is_where_the_filter_will_be_once_it_has_used_all_samples() -> None:
    samples = np.tile(some_sample(), (12, 1))
    samples[:, 0] = np.linspace(-1.0, 1.0, 12)
    expected = np.zeros(strapdown.NOMINAL_ROWS)
    expected[QUATERNION] = 1.0
    for sample in samples:
        expected = advanced(expected, sample)[0]
    assert output_beside_the_filter(samples)[-1] == pytest.approx(expected[:10], abs=1e-12)


def test_what_corrects_the_filter_reaches_the_output_without_a_jump() -> None:
    # Given a vehicle at rest, whose filter is moved by 0.4 m/s, and turned by 0.02 rad
    still = np.zeros((150, SAMPLE_COLUMNS))
    still[:, 2] = -GRAVITY_M_S2
    shown = output_beside_the_filter(still, {20: {VELOCITY: 0.4, QUATERNION + 3: 0.01}}.items())
    # Then the velocity follows in PX4's 0.25 s, the heading in twice the delay
    speed, heading_rad = shown[:, VELOCITY], 2.0 * shown[:, QUATERNION + 3]
    assert speed[20] == pytest.approx(0.4 * STEP_S / 0.25, rel=0.01)
    assert speed[20 + 62] == pytest.approx(0.4 * (1.0 - math.exp(-1.0)), rel=0.1)
    assert heading_rad[20] == 0.0
    assert heading_rad[20 + 6] == pytest.approx(0.02, rel=0.4)
    assert heading_rad[-1] == pytest.approx(0.02, rel=0.01)


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
    # By OPTICAL_FLOW_RAD 0 is none and 255 the best
    assert {sample.quality for sample in flow_samples(state)} == {0}
    assert {sample.quality for sample in flow_samples(body())} == {255}


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


# Of 1000 runs of a consistent filter so many lie within.
NEARLY_ALWAYS = 0.999


def count_innovations(navigation, name: str, totals: list[float]) -> None:
    """Add to the totals: values fused, y' S^-1 y, and how often a sample was turned down."""
    fuse = getattr(navigation, name)

    def fused(*sample) -> bool:
        accepted = fuse(*sample)
        if accepted:
            y = navigation._ekf.y
            totals[0] += len(y)
            totals[1] += float(y @ navigation._ekf.SI @ y)
        totals[2] += not accepted
        return accepted

    setattr(navigation, name, fused)


def test_innovations_are_as_large_as_the_filter_says():
    # Given four flights round a circle of 2 m at 1.5 m/s
    pooled = {sensor: [0.0, 0.0, 0.0] for sensor in ("flow", "range", "heading")}
    for seed in range(1, 5):
        flight, way = Flight(filtered(), seed), circle(2.0, 1.5)
        flight.climb()
        flight.fly_along(way, 4.0)
        for sensor, totals in pooled.items():
            count_innovations(flight.plant.onboard.filter, f"fuse_{sensor}", totals)
        flight.fly_along(lambda time_s, way=way: way(4.0 + time_s), 12.0)
    # Then each sensor's summed squares are chi-square distributed with as many degrees of freedom as values
    for sensor, (freedom, total_nis, rejected) in pooled.items():
        low, high = chi2.interval(NEARLY_ALWAYS, freedom)
        assert freedom > 100 and low < total_nis < high, sensor
        assert rejected <= 0.01 * freedom, sensor


def test_position_by_flow_drifts_and_by_cameras_does_not_and_the_gyroscopes_bias_is_found():
    flight = Flight(filtered())
    flight.climb()
    flight.fly(HOVER, 30.0)
    true = flight.plant.constants.gyroscope_bias_frd_rad_s
    assert flight.plant.onboard.filter.nominal[10:13] == pytest.approx(true, abs=0.0007)
    drift_m = float(np.hypot(*flight.position_error_m[:2]))
    assert 0.02 < drift_m < 1.0
    assert abs(flight.position_error_m[2]) < 0.05
    seen = Flight(filtered(changes=WITH_CAMERAS))
    seen.climb()
    errors = seen.fly(HOVER, 10.0)
    assert np.linalg.norm(seen.position_error_m) < 0.01
    # and so is the velocity: root of the mean squared error on one axis, of the horizontal two
    assert np.sqrt(np.mean(errors[:, :2] ** 2)) < 0.015


def test_a_hit_on_the_arms_stop_clips_and_flow_brings_the_velocity_back():
    flight, (before, clipped, seen, later) = hit_wall(filtered(), 4.0, after_ms=(48, 200, 600))
    # Given a hit that the accelerometer could not follow
    assert flight.output.clipping_counts[0] > 10
    assert before < 0.1
    # Then the velocity is wrong by what was clipped, and is put right within the output predictor's quarter of a second
    assert clipped > 1.5
    assert 0.4 * clipped < seen < 0.8 * clipped
    assert later < 0.15 * clipped
    assert flight.output.reset_counter == 0


def test_flow_that_comes_back_after_seconds_resets_the_velocity():
    # Given a camera that sees the ground up to 1 m, and a hover 1.5 m up
    flight = Flight(filtered(changes={"sensors": {"optical_flow": {"distance_max_m": 1.0}}}))
    low = TrajectorySetpoint(position_ned_m=(0.0, 0.0, -0.7), yaw_rad=0.0)
    flight.fly(low, 6.0)
    flight.fly(HOVER, 4.0)
    assert flight.output.reset_counter == 0
    deviation_m_s = flight.plant.onboard.variances()[1] ** 0.5
    # When it sees the ground again
    while flight.output.reset_counter == 0:
        flight.fly(low, 0.1)
    # Then the velocity jumps to it, once, and the filter is sure again
    assert flight.output.reset_counter == 1
    assert flight.plant.onboard.variances()[1] ** 0.5 < 0.5 * deviation_m_s
    assert np.linalg.norm(flight.velocity_error_m_s[:2]) < 0.15
    flight.fly(low, 3.0)
    assert flight.output.reset_counter == 1


def test_cameras_that_are_turned_down_for_a_second_reset_the_position():
    # Given a rigid hit seen by cameras alone, by a filter that allows next to nothing for clipping
    only = {name: {"fitted": False} for name in ("optical_flow", "range_finder", "compass")}
    changes = {"sensors": {**only, "motion_capture": {"fitted": True}}, "estimator": {"clipped_excess_m_s2": 4.9}}
    flight, (_, astray, later) = hit_wall(filtered("rigid", changes), 2.0, after_ms=(800, 5000))
    # Then its position runs away from the cameras', which its gate turns down, until it is reset to them
    assert astray > 1.0
    assert later < 0.1
    assert flight.output.reset_counter >= 1
    assert np.linalg.norm(flight.position_error_m) < 0.02
