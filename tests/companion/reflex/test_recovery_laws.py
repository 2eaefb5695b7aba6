"""Where a recovery comes to rest, by each law and in every direction alike, and with which attitudes it gets there."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.fence import Fence
from companion.flight.obstacle_map import FlightRoom
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO, along, minus, plus
from companion.reflex import config as set_to
from companion.reflex.belief.motion_estimator import Belief
from companion.reflex.config import MOST_TILT_RAD, RecoveryConfig
from companion.reflex.recovery.attitude_law import Lean, attitude_and_thrust, held_off, tilted, wanted
from companion.reflex.recovery.laws import RECOVERY_LAWS
from companion.reflex.surface import Contact, Surface, projected

AT, SOUTH = (4.0, -2.0, -1.5), (-1.0, 0.0, 0.0)
ALL_SPEEDS = (0.5, 1.0, 2.0, 3.5, 5.0)


def turned(vector, angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2])


def hit(speed_m_s, slant_rad=0.0):
    """North into a wall whose normal is turned from south by the slant."""
    return Contact(AT, (speed_m_s, 0.0, 0.0), turned(SOUTH, slant_rad))


def off_m(touched, place):
    return Surface(touched.position_ned_m, touched.normal_ned, 0.0).off_m(place)


def goal_of(name, touched, motion=None, **config):
    settings = RecoveryConfig(law=name, **config)
    motion = motion or touched.rebound(settings.restitution)
    goal = RECOVERY_LAWS[name].goal_ned_m(settings, touched, motion)
    clear = Surface(touched.position_ned_m, touched.normal_ned, settings.clearance_m).level_m
    return projected(goal, [(touched.normal_ned, clear)]) if RECOVERY_LAWS[name].leans else goal


# --- goals


@pytest.mark.parametrize("north", [2.0, -2.0])
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_eq_3_lies_back_along_the_approach_in_every_quadrant(north, east):
    goal = goal_of("paper", Contact(AT, (north, east, 0.7), SOUTH), gamma=(0.5, 0.25))
    assert (goal[0] - 4.0) / -north == pytest.approx(0.5), "gamma_1 |v_c1|, against the approach"
    assert (goal[1] + 2.0) / -east == pytest.approx(0.25), "gamma_2 |v_c2|, against the approach"
    assert goal[2] == -1.5, "height kept, climb or not"


def test_normal_goes_back_along_the_normal_and_keeps_or_damps_the_rest():
    # 2 m/s at 60 degrees from the normal: 1 m/s into the wall, 1.73 along it
    touched = hit(2.0, math.radians(60))
    goal, on = (goal_of("normal", touched, tangential=how) for how in ("damped", "kept"))
    assert off_m(touched, goal) == pytest.approx(0.5) and math.dist(goal, AT) == pytest.approx(0.5)
    assert off_m(touched, on) == pytest.approx(0.5) and math.dist(on, goal) == pytest.approx(0.5 * math.sqrt(3))
    # The adaptive law's goal goes on as far along it
    goal, on = (goal_of("adaptive", touched, tangential=how) for how in ("damped", "kept"))
    assert off_m(touched, on) == pytest.approx(off_m(touched, goal))
    assert math.dist(on, goal) == pytest.approx(0.5 * math.sqrt(3))


@pytest.mark.parametrize("speed", ALL_SPEEDS)
def test_adaptive_keeps_the_guards_clear_by_the_distance_asked_for(speed):
    touched = hit(speed)
    soft = goal_of("adaptive", touched, touched.rebound(0.0))
    assert off_m(touched, soft) == pytest.approx(0.35)
    assert soft[2] == AT[2], "height is held"
    # a stiff airframe that needs more room to stop gets it
    stiff = goal_of("adaptive", touched, touched.rebound(0.9))
    assert off_m(touched, stiff) == pytest.approx(max(0.35, 0.9 * speed * set_to.WAY_S))


@pytest.mark.parametrize("name", ["adaptive", "normal"])
@pytest.mark.parametrize("tangential", ["damped", "kept"])
def test_turning_or_mirroring_the_world_turns_or_mirrors_the_recovery(name, tangential):
    touched = Contact((0.0, 0.0, -2.0), (1.7, 0.4, 0.1), turned(SOUTH, 0.4))
    goal = goal_of(name, touched, touched.rebound(0.3), tangential=tangential)
    changes: Any = (lambda v: turned(v, 1.234), lambda v: (v[0], -v[1], v[2]))
    for change in changes:
        other = Contact(*(change(v) for v in (touched.position_ned_m, touched.velocity_ned_m_s, touched.normal_ned)))
        other_goal = goal_of(name, other, other.rebound(0.3), tangential=tangential)
        assert other_goal == pytest.approx(change(goal))


# --- half-spaces


@pytest.mark.parametrize("corner_deg", [60.0, 90.0, 120.0])
def test_projected_into_a_corner_a_vector_has_its_least_part_along_both_normals(corner_deg):
    sides = [(SOUTH, 0.5), (turned(SOUTH, math.radians(180.0 - corner_deg)), 0.3)]
    found = projected((2.0, 0.1, -1.0), sides)
    for (n, e, _), least in sides:
        assert n * found[0] + e * found[1] >= least - 0.02
    assert found[2] == -1.0
    assert projected(found, sides) == pytest.approx(found, abs=0.02)
    assert projected((-3.0, 0.0, 0.0), [(SOUTH, 0.5)]) == (-3.0, 0.0, 0.0), "what is inside stays"


ROOM = Fence(radius_m=6.0, max_height_m=3.0, min_height_m=0.4)


def test_from_a_ceiling_the_way_leads_down_but_never_into_the_floor():
    under = Contact((0.0, 0.0, -2.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    assert goal_of("adaptive", under) == pytest.approx((0.0, 0.0, -1.65))
    low = Contact((0.0, 0.0, -0.6), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    flight: Any = SimpleNamespace(mission=SimpleNamespace(fence=ROOM), origin_ned_m=ZERO)
    in_room = FlightRoom(flight).inside(low.position_ned_m, goal_of("adaptive", low))
    assert in_room == pytest.approx((0.0, 0.0, -0.4))


HERE, FULL_M_S2 = (0.0, 0.0, -2.0), 16.0
# A vehicle that is HERE has just touched it.
WALL = Surface(HERE, SOUTH, 0.35)
FAR = Surface((5.0, 0.0, -2.0), SOUTH, 0.35)


def lean(belief, surfaces=(), full_m_s2=FULL_M_S2) -> Lean:
    return Lean(belief, surfaces, full_m_s2, set_to.MOST_HELD_S + set_to.NOTICED_S)


def up_of(attitude_wxyz):
    return body_to_ned(attitude_wxyz, (0.0, 0.0, -1.0))


def flown(velocity, surfaces, wind_m_s2):
    """Places and velocities in 3 s of a vehicle whose attitude follows as a critically damped loop of 12 rad/s does."""
    place, up, turns, tick_s, path = HERE, (0.0, 0.0, -1.0), ZERO, 0.004, []
    for _ in range(round(3.0 / tick_s)):
        ahead = plus(up, 0.05, turns)
        tilt = (GRAVITY_M_S2 * ahead[0] / -ahead[2], GRAVITY_M_S2 * ahead[1] / -ahead[2], 0.0)
        belief = Belief(place, velocity, 0.0, tilt, wind_m_s2, tilted(up, 0.0))
        attitude, thrust = attitude_and_thrust(wanted(belief, surfaces, HERE[2]), lean(belief, surfaces))
        pulls = plus(plus(ZERO, 144.0, minus(up_of(attitude), up)), -24.0, turns)
        turns = plus(turns, tick_s, pulls)
        up = plus(up, tick_s, turns)
        force = plus(plus(wind_m_s2, thrust * FULL_M_S2, up), GRAVITY_M_S2, (0.0, 0.0, 1.0))
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


def test_what_has_left_a_wall_is_led_off_it_by_where_it_will_be_when_its_thrust_has_turned():
    def asked_m_s2(off_m, speed_m_s, spread_m_s=0.0):
        belief = Belief(plus(HERE, off_m, SOUTH), plus(ZERO, speed_m_s, SOUTH), spread_m_s)
        return wanted(belief, [WALL], HERE[2])[0]

    assert asked_m_s2(0.1, 0.6) == pytest.approx(-7.0 * (7.0 / 3.0 * (0.35 - 0.1 - 0.15 * 0.6) - 0.6))
    assert asked_m_s2(0.1, -0.6) == pytest.approx(-7.0 * (7.0 / 3.0 * (0.35 - 0.1 + 0.15 * 0.6) + 0.6))
    # and of a speed that is not certain by what is
    assert asked_m_s2(0.1, 0.6, 0.1) == pytest.approx(-7.0 * (7.0 / 3.0 * (0.35 - 0.1 - 0.15 * 0.5) - 0.5))
    # but not by more than it has left: what pushes it goes along with it
    assert asked_m_s2(0.0, 0.6) == pytest.approx(-7.0 * (7.0 / 3.0 * 0.35 - 0.6))


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


@pytest.mark.parametrize(
    ("off_m", "velocity_m_s", "presses_m_s2"),
    [(0.0, -0.3, set_to.HELD_M_S2), (0.2, 0.0, math.inf), (0.0, -2.5, math.inf)],
    ids=["turned onto it", "not at it", "follows it"],
)
def test_thrust_that_presses_on_a_surface_is_no_more_than_leads_off_it(off_m, velocity_m_s, presses_m_s2):
    # Given a vehicle below its height that will lean by 20 degrees into the wall, which it touches or is near to
    into_rad, place = math.radians(20.0), minus(HERE, (off_m, 0.0, 0.0))
    up = (math.sin(into_rad), 0.0, -math.cos(into_rad))
    belief = Belief(place, (velocity_m_s, 0.0, 0.0), 0.0, (GRAVITY_M_S2 * math.tan(into_rad), 0.0, 0.0))
    near = Surface(HERE, SOUTH, 0.25)
    asked = wanted(belief, [near], HERE[2] - 1.0)
    attitude, pressing = attitude_and_thrust(asked, lean(belief, [near]))
    # Then its thrust is the projection of the force that is wanted, not what would carry it, or climb; and where a hit
    # has turned it onto the wall it presses by less than tips it over
    leans, climbs_m_s2 = up_of(attitude), 0.0 if off_m == 0.0 else -4.0
    level_m_s2 = leans[0] / -leans[2] * (GRAVITY_M_S2 + 4.0)
    projection = along((level_m_s2, 0.0, climbs_m_s2 - GRAVITY_M_S2), up)
    assert pressing == pytest.approx(min(projection, presses_m_s2 / math.sin(into_rad)) / FULL_M_S2)
    # And in front of a wall that is far it is what carries it and climbs
    _, lifting = attitude_and_thrust(asked, lean(belief, [FAR]))
    assert lifting == pytest.approx((GRAVITY_M_S2 + 4.0) / FULL_M_S2)


@pytest.mark.parametrize(("low_m", "climbs_m_s", "climbs_m_s2"), [(0.1, 0.0, 1.6), (0.0, 0.2, -1.6)])
def test_it_comes_back_to_its_height_as_a_critically_damped_loop_of_4_rad_s(low_m, climbs_m_s, climbs_m_s2):
    belief = Belief(plus(HERE, low_m, (0.0, 0.0, 1.0)), (0.0, 0.0, -climbs_m_s))
    assert wanted(belief, (), HERE[2]) == pytest.approx((0.0, 0.0, -climbs_m_s2))


def test_under_a_ceiling_that_is_not_quite_level_it_is_carried_on():
    ceiling = Surface(HERE, (-0.05, 0.0, math.sqrt(1.0 - 0.05**2)), 0.35)
    _, thrust = attitude_and_thrust((-1.0, 0.0, 0.0), lean(Belief(HERE, ZERO), [ceiling]))
    assert thrust == pytest.approx(GRAVITY_M_S2 / FULL_M_S2, rel=0.01)


def test_a_vehicle_that_is_wrong_about_its_tilt_is_asked_for_what_makes_it_lean_as_meant():
    # Given one that accelerates by 1 m/s^2 to the north where it takes itself for level
    belief = Belief(HERE, ZERO, level_m_s2=(1.0, 0.0, 0.0))
    attitude, _ = attitude_and_thrust((1.0, 0.0, 0.0), lean(belief))
    assert up_of(attitude) == pytest.approx((0.0, 0.0, -1.0)), "level by its own attitude"


def test_a_vehicle_that_is_wrong_about_its_heading_leans_as_meant_and_does_not_turn():
    # Given one that heads east and takes itself for half a radian further to the south
    belief = Belief(HERE, ZERO, attitude_wxyz=tilted((0.0, 0.0, -GRAVITY_M_S2), 1.57), heading_error_rad=0.5)
    attitude, _ = attitude_and_thrust((3.0, 0.0, 0.0), lean(belief))
    # Then a lean to the north is one as far to the east for itself, and its heading is what it takes it for
    leans = (3.0 * math.cos(0.5), 3.0 * math.sin(0.5), -GRAVITY_M_S2)
    assert attitude == pytest.approx(tilted(leans, 2.07), abs=1e-9)


@pytest.mark.parametrize(
    ("full_m_s2", "upright"), [(13.0, GRAVITY_M_S2 / 13.0 / 0.85), (30.0, math.cos(MOST_TILT_RAD))]
)
def test_a_vehicle_that_turns_leans_by_what_px4_leaves_of_its_thrust_for_the_turn(full_m_s2, upright):
    belief = Belief(HERE, ZERO, yaw_rate_rad_s=4.0)
    attitude, _ = attitude_and_thrust((9.0, 0.0, 0.0), lean(belief, full_m_s2=full_m_s2))
    assert -up_of(attitude)[2] == pytest.approx(upright)


def test_a_weak_vehicle_leans_by_what_leaves_it_a_tenth_more_than_carries_it():
    attitude, _ = attitude_and_thrust((9.0, 0.0, 0.0), lean(Belief(HERE, ZERO), full_m_s2=13.0))
    assert -up_of(attitude)[2] == pytest.approx(1.1 * GRAVITY_M_S2 / 13.0)


def test_a_vehicle_that_turns_by_two_radians_within_its_attitudes_lag_leans_half_as_much():
    belief = Belief(HERE, ZERO, yaw_rate_rad_s=-2.0 / set_to.LEAD_S)
    attitude, _ = attitude_and_thrust((9.0, 0.0, 0.0), lean(belief, full_m_s2=30.0))
    n, _, d = up_of(attitude)
    assert n / -d == pytest.approx(0.5 * math.tan(MOST_TILT_RAD))


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, -3.0])
def test_a_lean_asks_for_no_turn_of_the_heading(heading_rad):
    # Given a vehicle that tilts east
    belief = Belief(HERE, ZERO, attitude_wxyz=tilted((0.0, 4.0, -GRAVITY_M_S2), heading_rad))
    attitude, _ = attitude_and_thrust((3.0, 0.0, 0.0), lean(belief))
    last_word = lean(belief).tilted_by((3.0, 0.0, 0.0)).setpoint(0, (3.0, 0.0, 0.0)).attitude_wxyz
    for asked in (attitude, last_word):
        assert asked == pytest.approx(tilted((3.0, 0.0, -GRAVITY_M_S2), heading_rad), abs=1e-9)


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
    attitude, thrust = attitude_and_thrust(acceleration, lean(belief, [WALL], full_m_s2))
    assert math.hypot(*attitude) == pytest.approx(1.0)
    assert -up_of(attitude)[2] >= math.cos(MOST_TILT_RAD) - 1e-9
    assert 0.12 <= thrust <= 1.0
