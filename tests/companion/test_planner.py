"""Plans and laws: never into a surface, within limits, at rest in the end, the same in every direction."""

import itertools
import math
import random
from dataclasses import replace

import pytest

from companion.fence import Fence
from companion.reflex.config import HARD_BRAKING, LEAD_S, SHORTEST_S, RecoveryConfig
from companion.reflex.halfspace import Surface, away_from, clear_goal, inside_fence, plus, split
from companion.reflex.laws import RECOVERY_LAWS, Contact
from companion.reflex.normal import Normal
from companion.reflex.planner import REST, MotionState, Plan, height_feedback, kept_off, shortest

AT, SOUTH = (4.0, -2.0, -1.5), (-1.0, 0.0, 0.0)
ALL_SPEEDS = (0.5, 1.0, 2.0, 3.5, 5.0)
MOST_M_S2 = 3.0


def turned(vector, angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2])


def mirrored(vector):
    return (vector[0], -vector[1], vector[2])


def hit(speed_m_s, slant_rad=0.0, climb_m_s=0.0):
    """North into a wall whose normal is turned from south by the slant."""
    return Contact(0, AT, (speed_m_s, 0.0, climb_m_s), turned(SOUTH, slant_rad))


def off_m(touched, place):
    return Surface(touched.position_ned_m, touched.normal_ned, 0.0).off_m(place)


def plan(state, goal):
    return shortest(state, lambda _: goal, MOST_M_S2)


def goal_of(name, touched, motion=None, **config):
    settings = RecoveryConfig(law=name, **config)
    motion = motion or touched.rebound(settings.restitution)
    return RECOVERY_LAWS[name].goal_ned_m(settings, touched, motion)


def adaptive(touched, motion, **config):
    goal = goal_of("adaptive", touched, motion, **config)
    return goal, plan(motion, goal)


def motions_of(found, lead_s=0.0):
    return [found.at(found.duration_s * step / 200, lead_s) for step in range(200)]


# --- plans


def some_motions(count, seed=1):
    """Any motion before a wall in the north that passes through AT: off it, into it, along it, leant anyhow."""
    draw = random.Random(seed)
    for _ in range(count):
        place = plus(AT, draw.uniform(0.0, 0.8), SOUTH)
        velocity = (draw.uniform(-4.0, 1.0), draw.uniform(-3.0, 3.0), draw.uniform(-1.0, 1.0))
        yield MotionState(place, velocity, (draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0), 0.0))


def test_a_plan_from_any_motion_is_finite_bounded_and_ends_at_rest_at_its_goal():
    for state in some_motions(300):
        found = plan(state, (2.5, -1.0, -1.5))
        motions = motions_of(found)
        values = [
            value
            for m in motions
            for v in (m.position_ned_m, m.velocity_ned_m_s, m.acceleration_ned_m_s2)
            for value in v
        ]
        assert all(map(math.isfinite, values))
        assert found.duration_s < 10.0
        end = found.at(found.duration_s - 1e-9)
        assert end.position_ned_m == pytest.approx(found.goal_ned_m, abs=1e-6)
        assert end.velocity_ned_m_s == pytest.approx(REST, abs=1e-6)
        assert found.at(found.duration_s + 1.0) == MotionState(found.goal_ned_m, REST)


@pytest.mark.parametrize("speed", ALL_SPEEDS)
@pytest.mark.parametrize("slant_deg", [-50, -20, 0, 30, 60])
@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.9])
def test_adaptive_never_plans_towards_the_obstacle_nor_past_its_goal(speed, slant_deg, restitution):
    touched = hit(speed, math.radians(slant_deg))
    goal, found = adaptive(touched, touched.rebound(restitution))
    for motion in motions_of(found):
        assert split(motion.velocity_ned_m_s, touched.normal_ned)[0] > -1e-9
        assert -1e-9 <= off_m(touched, motion.position_ned_m) <= off_m(touched, goal) + 1e-9
        assert math.hypot(*motion.acceleration_ned_m_s2) <= 3.0 * 1.02


def test_of_a_motion_that_is_no_number_a_plan_is_tried_once():
    assert plan(MotionState(AT, (math.nan, 0.0, 0.0)), AT).duration_s == SHORTEST_S


def test_where_no_normal_is_known_adaptive_asks_for_a_finite_place():
    touched = replace(hit(2.0), normal_ned=Normal().direction_ned, normal_error_rad=Normal().error_rad)
    assert all(map(math.isfinite, goal_of("adaptive", touched)))


def test_a_plan_made_anew_from_any_motion_on_it_is_the_same_plan():
    state = MotionState(REST, (1.5, -0.4, 0.2), (1.0, 0.0, 0.0))
    whole = Plan(state, (2.0, 0.5, 0.0), 1.6)
    half = Plan(whole.at(0.7, 0.0), whole.goal_ned_m, 0.9)
    for since_s in (0.0, 0.3, 0.8):
        for name in ("position_ned_m", "velocity_ned_m_s", "acceleration_ned_m_s2"):
            assert getattr(half.at(since_s), name) == pytest.approx(getattr(whole.at(0.7 + since_s), name), abs=1e-9)


def test_a_plan_goes_on_with_the_lean_that_there_is_and_takes_it_back():
    found = plan(MotionState(REST, (0.2, 0.0, 0.0), (3.0, 0.0, 0.0)), (1.2, 0.0, 0.0))
    step_s = 1e-4
    for time_s, motion in ((0.0, found.at(0.0, 0.0)), (0.5, found.at(0.5, 0.0))):
        x = [found.at(time_s + k * step_s, 0.0).position_ned_m[0] for k in (0, 1, 2)]
        assert (x[1] - x[0]) / step_s == pytest.approx(motion.velocity_ned_m_s[0], abs=1e-3)
        assert (x[2] - 2.0 * x[1] + x[0]) / step_s**2 == pytest.approx(motion.acceleration_ned_m_s2[0], abs=0.05)
    assert found.at(0.0, 0.0).acceleration_ned_m_s2[0] == pytest.approx(3.0)


@pytest.mark.parametrize("off_the_wall_m", [0.0, 0.2, 0.34])
def test_nothing_leads_into_a_surface_nearer_than_its_clearance(off_the_wall_m):
    wall = Surface(AT, SOUTH, 0.35)
    place = plus(AT, off_the_wall_m, SOUTH)
    for into_m_s2, tilt_m_s2, speed_m_s in itertools.product((-3.0, 0.0, 3.0), (-3.0, 0.0, 5.0), (-0.5, 0.0, 0.3)):
        state = MotionState(place, (speed_m_s, 0.2, 0.0), (tilt_m_s2, 0.0, 0.0))
        north_m_s2 = kept_off((into_m_s2, 1.0, 0.5), state, [wall], MOST_M_S2)[0]
        will_m_s = speed_m_s + 2.0 * LEAD_S * tilt_m_s2  # by when a new lean acts
        if will_m_s >= 0.0:
            assert north_m_s2 <= 0.0, "it stands, or comes nearer"
        if will_m_s > 0.2:
            assert north_m_s2 < -1.3, "it flies or leans into the wall: away"
        assert abs(north_m_s2) <= 3.0 * HARD_BRAKING
    beside = kept_off((3.0, 1.0, 0.5), MotionState(place, (0.0, 0.0, 0.0)), [wall], MOST_M_S2)
    assert beside[1:] == (1.0, 0.5), "along the surface nothing is taken away"
    assert kept_off((3.0, 1.0, 0.5), MotionState(plus(AT, 0.36, SOUTH), REST), [wall], MOST_M_S2)[0] == 3.0


def test_a_surface_far_behind_which_the_vehicle_is_keeps_it_off_nothing():
    # Given a vehicle that flies where a wall was thought to be, by more than arms give way and an estimate drifts
    wall = Surface(AT, SOUTH, 0.35)
    for deep_m, is_there in ((0.0, True), (0.15, True), (0.25, False), (3.0, False)):
        state = MotionState(plus(AT, -deep_m, SOUTH), (0.5, 0.0, 0.0))
        asked = kept_off((1.0, 0.0, 0.0), state, [wall], MOST_M_S2)
        assert (asked == (1.0, 0.0, 0.0)) is not is_there


def test_brakes_off_a_wall_are_let_through_for_as_long_as_they_only_brake():
    state = MotionState(plus(AT, 0.1, SOUTH), (-2.0, 0.0, 0.0))
    assert kept_off((3.0, 0.0, 0.0), state, [Surface(AT, SOUTH, 0.35)], MOST_M_S2) == (3.0, 0.0, 0.0)


def flown(state, goal, drift_m_s2=0.0, velocity_p=1.8, lag_rad_s=12.0, seconds=6.0):
    """Places of a vehicle with PX4's gains that follows a plan.

    Its thrust turns by a critically damped loop, its estimate and link are 35 ms late, and a wind that it is not
    trimmed for carries it off.
    """
    step_s, position_p, velocity_i, velocity_d = 0.005, 0.95, 0.4, 0.2
    found = plan(state, goal)
    late = [0.0] * 7
    (x, _, _), (v, _, _) = state.position_ned_m, state.velocity_ned_m_s
    lean = turning = integral = acceleration = 0.0
    places = []
    for step in range(round(seconds / step_s)):
        asked = found.at(step_s * step)
        wanted_m_s = asked.velocity_ned_m_s[0] + position_p * (asked.position_ned_m[0] - x)
        integral += velocity_i * (wanted_m_s - v) * step_s
        late.append(
            1.1 * asked.acceleration_ned_m_s2[0] + velocity_p * (wanted_m_s - v) + integral - velocity_d * acceleration
        )
        turning += step_s * (lag_rad_s**2 * (late.pop(0) - lean) - 2.0 * lag_rad_s * turning)
        lean += step_s * turning
        acceleration = lean + drift_m_s2
        v += step_s * acceleration
        x += step_s * v
        places.append(x)
    return places


@pytest.mark.parametrize("speed_m_s", [0.0, 0.8, 2.0, 3.0])
@pytest.mark.parametrize("drift_m_s2", [-0.4, 0.0, 0.4])
@pytest.mark.parametrize("lag_rad_s", [9.0, 12.0])
def test_a_vehicle_with_lag_and_drift_comes_to_rest_at_its_goal(speed_m_s, drift_m_s2, lag_rad_s):
    goal_m = max(0.5, 0.7 * speed_m_s)
    places = flown(MotionState(REST, (speed_m_s, 0.0, 0.0)), (goal_m, 0.0, 0.0), drift_m_s2, lag_rad_s=lag_rad_s)
    assert max(places) < goal_m + 0.45
    assert min(places) > -0.1, "nor back into what it came from"
    assert all(abs(place - goal_m) < 0.15 for place in places[-100:])


@pytest.mark.parametrize("speed_m_s", [-0.6, 0.4])
def test_a_climb_ends_sooner_than_by_the_vehicles_own_loop(speed_m_s):
    """Given that loop, w' = -4 (w + x), and motors that follow with 0.03 s."""
    ways = []
    for most_m_s2 in (3.0, 0.0):
        w, way, done, furthest = speed_m_s, 0.0, 0.0, 0.0
        for _ in range(500):
            asked = height_feedback(MotionState((0.0, 0.0, way), (0.0, 0.0, w)), 0.0, w, 0.0, 1.0, most_m_s2)
            assert abs(asked) <= most_m_s2
            done += 0.002 / 0.03 * (asked - 4.0 * (w + way) - done)
            w += 0.002 * done
            way += 0.002 * w
            furthest = max(furthest, abs(way))
        assert abs(w) < 0.1, "neither on nor back"
        ways.append(furthest)
    assert ways[0] < 0.7 * ways[1], "less than without; 0: none"


@pytest.mark.parametrize(
    ("spread_m_s", "told_m_s", "counts_m_s"),
    [(0.0, 0.0, -0.3), (0.1, 0.0, -0.2), (0.4, 0.0, 0.0), (0.4, -0.3, -0.3), (0.4, 0.05, 0.05), (0.1, -1.0, -0.4)],
)
def test_a_told_climb_counts_as_far_as_the_reckoned_one_allows(spread_m_s, told_m_s, counts_m_s):
    climbing = MotionState((0.0, 0.0, 0.0), (0.0, 0.0, -0.3))
    asked_m_s2 = height_feedback(climbing, spread_m_s, told_m_s, 0.0, 1.0, 3.0)
    assert asked_m_s2 == pytest.approx(-4.0 * counts_m_s)


# --- laws


@pytest.mark.parametrize("north", [2.0, -2.0])
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_eq_3_lies_back_along_the_approach_in_every_quadrant(north, east):
    goal = goal_of("paper", Contact(0, AT, (north, east, 0.7), SOUTH), gamma=(0.5, 0.25))
    assert (goal[0] - 4.0) / -north == pytest.approx(0.5), "gamma_1 |v_c1|, against the approach"
    assert (goal[1] + 2.0) / -east == pytest.approx(0.25), "gamma_2 |v_c2|, against the approach"
    assert goal[2] == -1.5, "height kept, climb or not"


def test_the_papers_own_numbers():
    """v_c = 2.1 m/s and gamma = 0.5 from x(t_c) = [0.6, 0, -0.5] give x_d = [-0.45, 0, -0.5]."""
    assert goal_of("paper", Contact(0, (0.6, 0.0, -0.5), (2.1, 0.0, 0.0), SOUTH)) == pytest.approx((-0.45, 0.0, -0.5))
    assert goal_of("paper", Contact(0, AT, REST, SOUTH)) == AT, "hit while hovering: stay"


def test_eq_3_is_asked_for_at_once_and_never_changed():
    assert not RECOVERY_LAWS["paper"].follows and not RECOVERY_LAWS["paper"].plans


def test_normal_goes_back_along_the_normal_and_keeps_or_damps_the_rest():
    # 2 m/s at 60 degrees from the normal: 1 m/s into the wall, 1.73 along it
    touched = hit(2.0, math.radians(60))
    goal, on = (goal_of("normal", touched, tangential=how) for how in ("damped", "kept"))
    assert off_m(touched, goal) == pytest.approx(0.5) and math.dist(goal, AT) == pytest.approx(0.5)
    assert off_m(touched, on) == pytest.approx(0.5) and math.dist(on, goal) == pytest.approx(0.5 * math.sqrt(3))


@pytest.mark.parametrize("speed", ALL_SPEEDS)
def test_adaptive_keeps_the_guards_clear_by_the_distance_asked_for(speed):
    touched = hit(speed)
    soft, _ = adaptive(touched, touched.rebound(0.0))
    assert off_m(touched, soft) == pytest.approx(max(0.35, 0.31 * speed))
    assert soft[2] == AT[2], "height is held"
    # a stiff airframe that needs more room to stop gets it: half its speed times the duration
    stiff, found = adaptive(touched, touched.rebound(0.9))
    assert off_m(touched, stiff) == pytest.approx(max(off_m(touched, soft), 0.45 * speed * found.duration_s), rel=0.06)


@pytest.mark.parametrize("name", ["adaptive", "normal"])
@pytest.mark.parametrize("tangential", ["damped", "kept"])
def test_turning_or_mirroring_the_world_turns_or_mirrors_the_recovery(name, tangential):
    touched = Contact(0, (0.0, 0.0, -2.0), (1.7, 0.4, 0.1), turned(SOUTH, 0.4))
    goal = goal_of(name, touched, touched.rebound(0.3), tangential=tangential)
    at = plan(touched.rebound(0.3), goal).at(0.3).position_ned_m
    for change in (lambda v: turned(v, 1.234), mirrored):
        other = Contact(0, *(change(v) for v in (touched.position_ned_m, touched.velocity_ned_m_s, touched.normal_ned)))
        other_goal = goal_of(name, other, other.rebound(0.3), tangential=tangential)
        assert other_goal == pytest.approx(change(goal))
        assert plan(other.rebound(0.3), other_goal).at(0.3).position_ned_m == pytest.approx(change(at))


def test_along_the_wall_adaptive_comes_to_rest_where_the_motion_along_it_ends():
    touched = hit(2.0, math.radians(60))
    goal, found = adaptive(touched, touched.rebound(0.2))
    along_m = 0.5 * math.sqrt(3) * found.duration_s
    assert off_m(touched, goal) == pytest.approx(0.35)
    beside_m = math.sqrt(math.dist(goal, AT) ** 2 - off_m(touched, goal) ** 2)
    assert beside_m == pytest.approx(along_m, rel=0.05), "half of v_t times the duration"


def test_a_hovering_vehicle_that_is_struck_gives_way():
    struck = Contact(0, AT, REST, (0.0, 1.0, 0.0))
    goal, _ = adaptive(struck, MotionState((4.0, -1.95, -1.5), (0.0, 0.45, 0.0)))
    assert goal[:2] == pytest.approx((4.0, -1.65)), "0.35 m from where it was struck, more than it takes to stop"


def test_what_overtook_the_vehicle_needs_no_more_clearance():
    # Given one that is struck from behind while it flies away from what strikes it
    fled = Contact(0, AT, (-3.0, 0.0, 0.0), SOUTH)
    assert fled.rebound(0.45).velocity_ned_m_s == (-3.0, 0.0, 0.0), "it goes on leaving"
    goal, _ = adaptive(fled, MotionState(AT, REST), clearance_s=0.5)
    assert off_m(fled, goal) == pytest.approx(0.35), "the speed away asks for none"


def test_where_a_leant_vehicle_comes_to_rest_is_asked_for():
    # Given one that stands where it touched, leant away: taking the lean back carries it off by a T^2 / 12
    goal, found = adaptive(hit(1.0), MotionState(AT, REST, (-3.0, 0.0, 0.0)), clearance_m=0.1, clearance_s=0.0)
    assert off_m(hit(1.0), goal) == pytest.approx(3.0 * found.duration_s**2 / 12.0, rel=1e-6)


# --- half-spaces


@pytest.mark.parametrize(
    ("normal", "away"),
    [
        ((-0.9, 0.1, 0.3), (-0.9939, 0.1104, 0.0)),  # a wall, and the vehicle leant: height is held
        ((0.05, 0.0, 0.99), (0.0504, 0.0, 0.9987)),  # a ceiling: away is down
        ((0.0, 0.0, -1.0), (0.0, 0.0, -1.0)),  # a floor
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ],
)
def test_away_is_level_from_a_wall_and_straight_from_what_is_steep(normal, away):
    assert away_from(normal) == pytest.approx(away, abs=1e-3)


ROOM = Fence(radius_m=6.0, max_height_m=3.0, min_height_m=0.4)


def in_room(surfaces, contact_m, normal, goal_m):
    return inside_fence(ROOM, REST, contact_m, clear_goal(surfaces, contact_m, normal, goal_m))


def test_from_a_ceiling_the_way_leads_down_but_never_into_the_floor():
    under = Contact(0, (0.0, 0.0, -2.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    assert goal_of("adaptive", under) == pytest.approx((0.0, 0.0, -1.65))
    low = Contact(0, (0.0, 0.0, -0.6), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    goal = goal_of("adaptive", low)
    assert in_room((), low.position_ned_m, low.normal_ned, goal) == pytest.approx((0.0, 0.0, -0.4))


def test_the_fence_stops_a_recovery():
    touched = Contact(0, (5.5, 0.0, -1.5), (-5.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    motion = touched.rebound(0.5)
    goal = in_room((), touched.position_ned_m, touched.normal_ned, goal_of("adaptive", touched, motion))
    assert goal[0] == pytest.approx(6.0)


FENCE, FENCE_AT = Fence(radius_m=5.0, max_height_m=6.0), (10.0, 0.0, 2.0)


def test_a_setpoint_inside_the_fence_is_left_alone():
    assert inside_fence(FENCE, FENCE_AT, (12.0, 0.0, 0.0), (11.0, 1.0, 0.0)) == (11.0, 1.0, 0.0)


def test_the_way_back_is_shortened_at_the_fence_not_bent():
    clamped = inside_fence(FENCE, FENCE_AT, (10.0, 3.0, 0.0), (18.0, 3.0, 0.0))
    assert math.hypot(clamped[0] - 10.0, clamped[1]) == pytest.approx(5.0)
    assert clamped == pytest.approx((14.0, 3.0, 0.0)), "still on the line from the contact to the wish"


def test_a_contact_outside_the_fence_is_answered_with_the_nearest_place_inside():
    assert inside_fence(FENCE, FENCE_AT, (17.0, 0.0, 0.0), (19.0, 0.0, 0.0)) == pytest.approx((15.0, 0.0, 0.0))


def test_height_is_limited_from_the_arming_position():
    assert inside_fence(FENCE, FENCE_AT, (10.0, 0.0, -5.0), (10.0, 0.0, -5.0))[2] == -4.0


NORTH_WALL = Surface((3.0, 2.0, -1.5), SOUTH, 0.5)


def test_out_of_a_corner_the_goal_is_clear_of_both_walls():
    """Leaving the north wall when the east wall is hit: eq. 3 alone leads back into the first."""
    east_wall = Contact(0, (2.7, 2.8, -1.5), (-0.4, 1.4, 0.0), (0.0, -1.0, 0.0))
    alone = goal_of("paper", east_wall)
    assert alone[0] > 2.7
    goal = in_room((NORTH_WALL,), east_wall.position_ned_m, east_wall.normal_ned, alone)
    assert goal == pytest.approx((2.5, alone[1], -1.5))
    further = (1.0, 2.0, -1.5)
    assert in_room((NORTH_WALL,), east_wall.position_ned_m, east_wall.normal_ned, further) == further


def test_a_surface_that_the_vehicle_is_behind_is_not_there():
    """Of a wall that was brushed the normal was 70 degrees wrong, and the vehicle flew on along it, behind that."""
    # Given a hit on the same wall half a metre behind that surface, and a goal off the wall
    touched = Contact(0, (3.5, 4.0, -1.5), (0.5, 0.9, 0.0), (0.34, -0.94, 0.0))
    wanted = (3.6, 3.7, -1.5)
    # Then it is not moved through where the vehicle is, back into the wall
    assert in_room((NORTH_WALL,), touched.position_ned_m, touched.normal_ned, wanted) == wanted
    # but a touch that lies a decimetre deeper than the surface is the estimate's
    assert in_room((NORTH_WALL,), (3.1, 4.0, -1.5), touched.normal_ned, wanted)[0] == pytest.approx(2.5)


@pytest.mark.parametrize(("gap_m", "north_m"), [(3.0, 1.0), (1.2, 2.5), (0.6, 2.7)])
def test_between_walls_that_face_each_other_the_goal_stays_between(gap_m, north_m):
    """The south wall is touched `gap_m` south of where the north wall was; away from it is towards the north wall."""
    south = Contact(0, (3.0 - gap_m, 2.0, -1.5), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    wanted = (4.0 - gap_m, 2.0, -1.5)
    goal = in_room((NORTH_WALL,), south.position_ned_m, south.normal_ned, wanted)
    assert goal[0] == pytest.approx(min(wanted[0], north_m), abs=1e-9)
