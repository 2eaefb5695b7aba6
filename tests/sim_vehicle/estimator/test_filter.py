"""The filter in flight: as good as it says, led astray by a hit that clips, and back."""

import numpy as np
import pytest
from scipy.stats import chi2

from sim_vehicle.control.setpoint import TrajectorySetpoint
from tests.sim_vehicle.estimator.flying import HOVER, WITH_CAMERAS, Flight, circle, filtered, hit_wall


def rms(errors) -> float:
    """Root of the mean squared error on one axis, of the horizontal two."""
    return float(np.sqrt(np.mean(errors[:, :2] ** 2)))


@pytest.fixture(scope="module")
def hover():
    flight = Flight(filtered())
    flight.climb()
    return flight, flight.fly(HOVER, 30.0)


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
            count_innovations(flight.onboard.filter, f"fuse_{sensor}", totals)
        flight.fly_along(lambda time_s, way=way: way(4.0 + time_s), 12.0)
    # Then each sensor's summed squares are chi-square distributed with as many degrees of freedom as values
    for sensor, (freedom, total_nis, rejected) in pooled.items():
        low, high = chi2.interval(NEARLY_ALWAYS, freedom)
        assert freedom > 100 and low < total_nis < high, sensor
        assert rejected <= 0.01 * freedom, sensor


def test_position_by_flow_drifts_and_by_cameras_does_not(hover):
    flight, _ = hover
    drift_m = float(np.hypot(*flight.position_error_m[:2]))
    assert 0.02 < drift_m < 1.0
    assert abs(flight.position_error_m[2]) < 0.05
    seen = Flight(filtered(changes=WITH_CAMERAS))
    seen.climb()
    errors = seen.fly(HOVER, 10.0)
    assert np.linalg.norm(seen.position_error_m) < 0.01
    assert rms(errors) < 0.015


def test_the_filter_finds_the_gyroscopes_bias(hover):
    flight, _ = hover
    true = flight.plant.constants.gyroscope_bias_frd_rad_s
    assert flight.onboard.filter.nominal[10:13] == pytest.approx(true, abs=0.0007)


def test_a_hit_on_the_arms_stop_clips_and_flow_brings_the_velocity_back():
    flight, (before, clipped, seen, later) = hit_wall(filtered(), 4.0, seed=1, after_ms=(48, 200, 1000))
    # Given a hit that the accelerometer could not follow
    assert flight.output.clipping_counts[0] > 10
    assert before < 0.1
    # Then the velocity is wrong by what was clipped, until the next flow samples
    assert clipped > 0.3
    assert seen < 0.15
    assert later < 0.1
    assert flight.output.reset_counter == 0


def test_flow_that_comes_back_after_seconds_resets_the_velocity():
    # Given a camera that sees the ground up to 1 m, and a hover 1.5 m up
    flight = Flight(filtered(changes={"sensors": {"optical_flow": {"distance_max_m": 1.0}}}))
    low = TrajectorySetpoint(position_ned_m=(0.0, 0.0, -0.7), yaw_rad=0.0)
    flight.fly(low, 6.0)
    flight.fly(HOVER, 4.0)
    assert flight.output.reset_counter == 0
    deviation_m_s = flight.onboard.variances()[1] ** 0.5
    # When it sees the ground again
    while flight.output.reset_counter == 0:
        flight.fly(low, 0.1)
    # Then the velocity jumps to it, once, and the filter is sure again
    assert flight.output.reset_counter == 1
    assert flight.onboard.variances()[1] ** 0.5 < 0.5 * deviation_m_s
    assert np.linalg.norm(flight.velocity_error_m_s[:2]) < 0.15
    flight.fly(low, 3.0)
    assert flight.output.reset_counter == 1


def test_cameras_that_are_turned_down_for_a_second_reset_the_position():
    # Given a rigid hit seen by cameras alone, by a filter that allows next to nothing for clipping
    only = {name: {"fitted": False} for name in ("optical_flow", "range_finder", "compass")}
    changes = {"sensors": {**only, "motion_capture": {"fitted": True}}, "estimator": {"clipped_excess_m_s2": 4.9}}
    flight, (_, astray, later) = hit_wall(filtered("rigid", changes), 2.0, seed=1, after_ms=(800, 3000))
    # Then its position runs away from the cameras', which its gate turns down, until it is reset to them
    assert astray > 1.0
    assert later < 0.1
    assert flight.output.reset_counter >= 1
    assert np.linalg.norm(flight.position_error_m) < 0.02
