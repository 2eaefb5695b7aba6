"""Whatever is written in a mission file is a mission or a sentence, and its ways to fly stay within the limits."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.interpolate import CubicSpline

from companion.mission.item_trajectory import SpeedLimits, trajectory_of
from companion.mission.items import GoToItem, VelocityItem
from companion.mission.model import Mission, itinerary, steps_to_fly
from companion.mission.trajectory import Chain, CircleProfile, CurveProfile, LineProfile

WHOLE = {
    "name": "t",
    "items": [
        {"takeoff": {"height_m": 2}},
        {"set_speed": {"speed_m_s": 2}},
        {"go_to": {"position_ned_m": [3, 1, -2], "yaw_deg": 20}, "on_collision": {"then": "retry"}, "timeout_s": 9},
        {"path": {"points_ned_m": [[1, 2, -2], [3, -1, -2.5]], "yaw_deg": "along"}},
        {"repeat": {"times": 2, "items": [{"velocity": {"velocity_ned_m_s": [0, 1, 0], "duration_s": 2}}]}},
        {"orbit": {"centre_ned_m": [2, 0, -2], "radius_m": 2, "turns": 1}},
        {"wait_for": {"steady": {"within_m": 0.2}}},
        {"expect": {"collision": {"within_s": 5}}},
        {"set_yaw": {"yaw_deg": 90}},
        {"hold": {"duration_s": 1}},
        {"return": {"height_m": 3}},
    ],
    "fence": {"polygon_ne_m": [[-8, -8], [8, -8], [8, 8], [-8, 8]], "max_height_m": 5},
    "limits": {"max_speed_m_s": 5},
    "abort_when": {"battery_below_percent": 20},
}


def _paths(value, path=()):
    yield path
    for key, below in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from _paths(below, (*path, key))


PATHS = list(_paths(WHOLE))[1:]
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.sampled_from([0, -1, 1e300, 1e-300])
)
VALUES = st.recursive(
    SCALARS,
    lambda below: (
        st.lists(below, max_size=4)
        | st.dictionaries(st.sampled_from(["items", "times", "go_to", "position_ned_m", "radius_m", "then"]), below)
    ),
    max_leaves=6,
)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.sampled_from(PATHS), VALUES)
def test_one_part_replaced_by_anything(path, value):
    data = copy.deepcopy(WHOLE)
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    try:
        mission = Mission.model_validate(data)
    except ValidationError as error:
        assert all(part["msg"] for part in error.errors())
        return
    # what is accepted can be planned
    legs = list(itinerary(mission))
    assert len(steps_to_fly(mission)) == len(legs) and min(leg.lasts_s or 0.0 for leg in legs) >= 0.0


def test_the_time_of_a_wait_with_an_end_and_of_a_turn_is_known():
    there = {"go_to": {"position_ned_m": [0, 0, -1.5], "yaw_deg": 180}}
    wait = {"wait_for": {"flight_time_s": 900}, "timeout_s": 950}
    mission = Mission.model_validate(
        {"name": "t", "items": [{"takeoff": {"height_m": 1.5}}, wait, there, {"land": {}}]}
    )
    still = mission.model_copy(update={"items": (mission.items[0], mission.items[1], mission.items[3])})
    still_s, moving_s = (sum(leg.lasts_s for leg in itinerary(each)) for each in (still, mission))
    assert 900.0 < still_s < 940.0 and moving_s >= still_s + 4.0


ZIGZAG = [(0.0, 0.0, -2.0), (2.0, 1.0, -2.0), (4.0, -1.0, -2.5), (6.0, 0.0, -3.0)]
CIRCLE = CircleProfile((3.0, 0.0, -2.0), 2.0, math.pi, 1.5 * math.tau, 2.0, 2.0)
WAYS = {
    "line": LineProfile((0.0, 0.0, -2.0), (0.4, -0.3, -1.5), 2.0, 1.5),
    "curve": CurveProfile(ZIGZAG, 2.0, 2.0),
    "hairpin": CurveProfile([(0.0, 0.0, -2.0), (5.0, 0.0, -2.0), (5.0, 0.4, -2.0), (0.0, 0.4, -2.0)], 3.0, 2.0),
    "straight curve": CurveProfile([(0.0, 0.0, -2.0), (1.0, 0.0, -2.0), (5.0, 0.0, -2.0)], 2.0, 2.0),
    "circle": CIRCLE,
    "anticlockwise": CircleProfile((0.0, 0.0, -2.0), 0.5, 0.0, -math.tau, 2.0, 2.0),
    # Too short to reach its 3 m/s
    "velocity": trajectory_of(
        VelocityItem(velocity_ned_m_s=(0.0, -3.0, 0.0), duration_s=2.0), (1.0, 1.0, -2.0), SpeedLimits(1.0, 2.0)
    ),
    "chain": Chain((LineProfile((0.0, 0.0, -2.0), (1.0, 0.0, -2.0), 2.0, 2.0), CIRCLE)),
}


@pytest.mark.parametrize("name", WAYS)
def test_velocity_is_the_derivative_of_position_within_the_limits(name):
    trajectory, dt = WAYS[name], 0.002
    times = np.arange(0.0, trajectory.duration_s + dt, dt)
    position, velocity, acceleration = (np.array(part) for part in zip(*map(trajectory.at, times), strict=True))
    assert np.linalg.norm(velocity, axis=1).max() <= (3.0 if name == "hairpin" else 2.0) + 1e-9
    assert np.linalg.norm(acceleration, axis=1).max() <= 2.0 * 1.02
    # within a setpoint's time the table is linear, and at the ends of a ramp the acceleration jumps
    moved = np.diff(position, axis=0)
    assert np.abs(moved - 0.5 * (velocity[1:] + velocity[:-1]) * dt).max() < 0.03 * dt
    mean = 0.5 * (acceleration[1:] + acceleration[:-1])
    misfit = np.abs(np.diff(velocity, axis=0) / dt - mean).max(axis=1)
    assert np.quantile(misfit, 0.9) < 0.1
    assert np.allclose(velocity[[0, -1]], 0.0, atol=1e-6)
    assert np.linalg.norm(moved, axis=1).sum() == pytest.approx(trajectory.distance_m, rel=2e-3)
    assert tuple(position[-1]) == pytest.approx(trajectory.target_m, abs=1e-6)


def test_a_curve_is_a_natural_cubic_spline():
    """As scipy's, over its own knots."""
    points = np.array(ZIGZAG)
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1)))])
    spline = CubicSpline(knots, points, bc_type="natural")
    looked_at = spline(np.linspace(0.0, knots[-1], 20_000))
    trajectory = CurveProfile(ZIGZAG, 3.0, 2.0)
    for t in np.linspace(0.0, trajectory.duration_s, 50):
        assert np.linalg.norm(looked_at - np.array(trajectory.at(t)[0]), axis=1).min() < 1e-3


@pytest.mark.parametrize(
    "trajectory",
    [
        LineProfile((0.0, 0.0, -2.0), (8.0, 0.0, -2.0), 3.0, 2.0, 1.0),
        CurveProfile(ZIGZAG, 3.0, 2.0, 1.0),
        CircleProfile((3.0, 0.0, -2.0), 2.0, math.pi, 1.5 * math.tau, 2.0, 2.0, 1.0),
        trajectory_of(
            VelocityItem(velocity_ned_m_s=(2.0, 0.0, 0.0), duration_s=5.0),
            (0.0, 0.0, -2.0),
            SpeedLimits(1.0, 2.0, speeding_up_m_s2=1.0),
        ),
    ],
)
def test_the_velocity_grows_and_turns_slower_than_it_falls(trajectory):
    times = np.arange(0.0, trajectory.duration_s, 0.02)
    _, velocity, acceleration = (np.array(part) for part in zip(*map(trajectory.at, times), strict=True))
    changes = np.diff(np.linalg.norm(velocity, axis=1)) / 0.02
    assert changes.max() == pytest.approx(1.0, abs=0.05)
    assert changes.min() < -1.1
    # Nor does it turn faster
    (v_n, v_e, _), (a_n, a_e, _) = velocity[1:-1].T, acceleration[1:-1].T
    assert (np.abs(v_n * a_e - v_e * a_n) / np.hypot(v_n, v_e)).max() < 1.03
    assert math.dist(trajectory.at(trajectory.duration_s - 1e-6)[0], trajectory.target_m) < 1e-4


@pytest.mark.parametrize(("speed_m_s", "tried_m_s"), [(2.0, 0.5), (0.8, 0.3), (0.2, 0.2)])
def test_another_try_is_slower_but_not_so_slow_that_nobody_notices_the_touch(speed_m_s, tried_m_s):
    go_to = GoToItem(position_ned_m=(1.0, 0.0, -1.0))
    assert SpeedLimits(speed_m_s, 2.0, factor=0.25).limits(go_to)[0] == pytest.approx(tried_m_s)
    velocity = VelocityItem(velocity_ned_m_s=(speed_m_s, 0.0, 0.0), duration_s=20.0)
    trajectory = trajectory_of(velocity, (0.0, 0.0, -2.0), SpeedLimits(1.0, 2.0, factor=0.25))
    assert trajectory.at(10.0)[1][0] == pytest.approx(tried_m_s)
