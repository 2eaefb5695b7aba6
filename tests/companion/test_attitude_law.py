"""The attitude law: to rest, clear of what is near, with attitudes and thrusts that a vehicle can fly."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO, along, minus, plus
from companion.reflex.attitude_law import Belief, Lean, attitude_and_thrust, held_off, tilted, wanted
from companion.reflex.config import LEAST_THRUST, MOST_HELD_S, MOST_TILT_RAD, NOTICED_S
from companion.reflex.surface import Surface

HERE, FULL_M_S2 = (0.0, 0.0, -2.0), 16.0
SOUTH = (-1.0, 0.0, 0.0)
# A vehicle that is HERE has just touched it.
WALL = Surface(HERE, SOUTH, 0.35)
FAR = Surface((5.0, 0.0, -2.0), SOUTH, 0.35)


def lean(belief, surfaces=(), heading_rad=0.0, full_m_s2=FULL_M_S2) -> Lean:
    return Lean(belief, surfaces, full_m_s2, heading_rad, MOST_HELD_S + NOTICED_S)


def up_of(attitude_wxyz):
    return body_to_ned(attitude_wxyz, (0.0, 0.0, -1.0))


def flown(velocity, surfaces, wind_m_s2=ZERO, full_m_s2=FULL_M_S2, believed_full_m_s2=FULL_M_S2, seconds=3.0):
    """Places and velocities of a vehicle whose attitude follows as a critically damped loop of 12 rad/s does."""
    place, up, turns, tick_s, path = HERE, (0.0, 0.0, -1.0), ZERO, 0.004, []
    for _ in range(round(seconds / tick_s)):
        ahead = plus(up, 0.05, turns)
        tilt = (GRAVITY_M_S2 * ahead[0] / -ahead[2], GRAVITY_M_S2 * ahead[1] / -ahead[2], 0.0)
        belief = Belief(place, velocity, 0.0, tilt, wind_m_s2, tilted(up, 0.0))
        asked = lean(belief, surfaces, full_m_s2=believed_full_m_s2)
        attitude, thrust = attitude_and_thrust(wanted(belief, surfaces, HERE[2]), asked)
        pulls = plus(plus(ZERO, 144.0, minus(up_of(attitude), up)), -24.0, turns)
        turns = plus(turns, tick_s, pulls)
        up = plus(up, tick_s, turns)
        force = plus(plus(wind_m_s2, thrust * full_m_s2, up), GRAVITY_M_S2, (0.0, 0.0, 1.0))
        velocity = plus(velocity, tick_s, force)
        place = plus(place, tick_s, velocity)
        path.append((place, velocity))
    return path


@pytest.mark.parametrize("speed_m_s", [0.3, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("wind_m_s2", [ZERO, (1.0, -0.5, 0.0)])
def test_a_vehicle_that_leaves_a_wall_is_at_rest_within_a_second_and_clear(speed_m_s, wind_m_s2):
    path = flown((-speed_m_s, 0.4, 0.0), [WALL], wind_m_s2)
    late = path[250:] if speed_m_s <= 2.0 else path[325:]
    assert max(math.hypot(*velocity) for _, velocity in late) < 0.2
    assert WALL.off_m(path[-1][0]) > 0.33
    assert max(abs(place[2] - HERE[2]) for place, _ in path) < 0.1, "the height is kept"
    assert min(WALL.off_m(place) for place, _ in path) > -0.02, "never back into the wall"


def test_near_a_surface_only_what_is_certain_of_the_speed_away_from_it_is_braked():
    off = Belief(HERE, (-2.0, 0.0, 0.0))
    certain, doubtful, unknown = (wanted(replace(off, spread_m_s=s), [WALL], HERE[2])[0] for s in (0.0, 0.6, 5.0))
    assert certain - doubtful == pytest.approx(7.0 * 0.6)
    # and not more: what may leave fast enough is not sped up
    assert unknown == pytest.approx(0.0)
    # far from it, and along it, all of it
    assert wanted(replace(off, spread_m_s=0.6), [FAR], HERE[2]) == wanted(off, [FAR], HERE[2])
    beside = Belief(HERE, (0.0, 1.0, 0.0))
    doubtful = wanted(replace(beside, spread_m_s=0.6), [WALL], HERE[2])
    assert doubtful == wanted(beside, [WALL], HERE[2])


@pytest.mark.parametrize("spread_m_s", [0.0, 0.4, 2.0])
def test_what_is_held_is_safe_by_what_is_certain_of_the_speed_away_from_a_surface(spread_m_s):
    place, held_s = plus(HERE, 0.6, SOUTH), 0.5
    belief = Belief(place, (-1.0, 0.0, 0.0), spread_m_s)
    (north_m_s2, _, _) = held_off((9.0, 0.0, 0.0), belief, [WALL], held_s)
    certain_m_s = max(0.0, 1.0 - spread_m_s)
    ends_m_s = north_m_s2 * held_s - certain_m_s
    # Braked with 3 m/s^2 from there it ends the clearance off the wall
    way_m = 0.5 * (ends_m_s - certain_m_s) * held_s + ends_m_s**2 / 6.0
    assert ends_m_s > 0.0 and way_m == pytest.approx(0.6 - WALL.distance_m, abs=0.01)


def test_thrust_that_presses_on_a_surface_is_no_more_than_leads_off_it():
    # Given a vehicle that leans by 40 degrees into the wall that it touches
    into = tilted((math.sin(math.radians(40.0)), 0.0, -math.cos(math.radians(40.0))), 0.0)
    belief = Belief(HERE, ZERO, attitude_wxyz=into)
    near = Surface(HERE, SOUTH, 0.25)
    asked = wanted(belief, [near], HERE[2])
    _, pressing = attitude_and_thrust(asked, lean(belief, [near]))
    _, lifting = attitude_and_thrust(asked, lean(belief, [FAR]))
    # Then its thrust is the projection of the wanted force, not what would carry it
    force = plus(asked, -GRAVITY_M_S2, (0.0, 0.0, 1.0))
    assert pressing == pytest.approx(max(LEAST_THRUST, along(force, up_of(into)) / FULL_M_S2))
    assert pressing < 0.75 * lifting


def test_a_vehicle_that_is_wrong_about_its_tilt_is_asked_for_what_makes_it_lean_as_meant():
    # Given one that accelerates by 1 m/s^2 to the north where it takes itself for level
    belief = Belief(HERE, ZERO, level_m_s2=(1.0, 0.0, 0.0))
    attitude, _ = attitude_and_thrust((1.0, 0.0, 0.0), lean(belief))
    assert up_of(attitude) == pytest.approx((0.0, 0.0, -1.0)), "level by its own attitude"


@given(
    acceleration=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    turned=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1),
    full_m_s2=st.floats(11.0, 60.0),
)
def test_whatever_is_asked_for_the_attitude_is_upright_and_the_thrust_one_that_there_is(
    acceleration, turned, full_m_s2
):
    # Given an acceleration as of a vehicle that shoots up to the top of its fence, faster than gravity stops it
    size = math.hypot(*turned)
    belief = Belief(HERE, ZERO, attitude_wxyz=tuple(part / size for part in turned))
    attitude, thrust = attitude_and_thrust(acceleration, lean(belief, [WALL], 1.0, full_m_s2))
    assert math.hypot(*attitude) == pytest.approx(1.0)
    assert -up_of(attitude)[2] >= math.cos(MOST_TILT_RAD) - 1e-9
    assert LEAST_THRUST <= thrust <= 1.0
