"""Recovery laws: never towards the obstacle, within limits, the same in every direction, clear of what is around."""

import math

import pytest

from companion.estimate.approach import VelocityFix
from companion.flight.rebound import agreed_normal, believable, is_free, lean_left
from companion.messages import LocalPosition
from companion.mission.fence import Fence
from companion.recovery.adaptive import AdaptiveLaw
from companion.reflex.halfspace import away_from
from companion.reflex.halfspace import Envelope
from companion.recovery.interface import Contact, Moving, RecoveryConfig
from companion.recovery.normal import NormalLaw
from companion.reflex.laws import RECOVERY_LAWS
from companion.reflex.halfspace import Room, Surface
from companion.recovery.way import SHORTEST_S, Glide, damped, glide

AT = (4.0, -2.0, -1.5)
ALL_SPEEDS = (0.5, 1.0, 2.0, 3.5, 5.0)


def turned(vector, angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2])


def mirrored(vector):
    return (vector[0], -vector[1], vector[2])


def hit(speed_m_s, slant_rad=0.0, climb_m_s=0.0):
    """North into a wall whose normal is turned from south by the slant."""
    return Contact(0, AT, (speed_m_s, 0.0, climb_m_s), turned((-1.0, 0.0, 0.0), slant_rad))


def rebound(touched, restitution, position=None):
    into = -sum(v * n for v, n in zip(touched.velocity_ned_m_s, touched.normal_ned, strict=True))
    pairs = zip(touched.velocity_ned_m_s, touched.normal_ned, strict=True)
    return Moving(position or touched.position_ned_m, tuple(v + (1 + restitution) * into * n for v, n in pairs))


def off_m(touched, place):
    return sum(n * (p - x) for n, p, x in zip(touched.normal_ned, place, touched.position_ned_m, strict=True))


def adaptive(touched, motion, **config):
    law = AdaptiveLaw(RecoveryConfig(**config))
    goal = law.goal_ned_m(touched, motion)
    return goal, law.way(motion, goal)


def times_of(way):
    return [way.duration_s * step / 200 for step in range(201)]


@pytest.mark.parametrize("speed", ALL_SPEEDS)
@pytest.mark.parametrize("slant_deg", [-50, -20, 0, 30, 60])
@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.9])
def test_adaptive_never_asks_to_go_towards_the_obstacle_nor_past_its_goal(speed, slant_deg, restitution):
    touched = hit(speed, math.radians(slant_deg))
    goal, way = adaptive(touched, rebound(touched, restitution))
    places = [way.at(time_s) for time_s in times_of(way)]
    for motion in places[:-1]:
        towards_m_s = sum(v * n for v, n in zip(motion.velocity_ned_m_s, touched.normal_ned, strict=True))
        assert towards_m_s > -1e-9
        assert -1e-9 <= off_m(touched, motion.position_ned_m) <= off_m(touched, goal) + 1e-9
    assert places[-1].position_ned_m == pytest.approx(goal)
    assert way.at(way.duration_s + 0.01).velocity_ned_m_s is None


@pytest.mark.parametrize("speed", ALL_SPEEDS)
def test_adaptive_keeps_the_guards_clear_by_the_distance_asked_for(speed):
    touched = hit(speed)
    soft, _ = adaptive(touched, rebound(touched, 0.0))
    assert off_m(touched, soft) == pytest.approx(max(0.35, 0.31 * speed))
    assert soft[2] == AT[2], "height is held"
    # a stiff airframe that needs more room to stop gets it
    stiff, _ = adaptive(touched, rebound(touched, 0.9))
    assert off_m(touched, stiff) >= off_m(touched, soft)
    assert off_m(touched, stiff) == pytest.approx(
        max(off_m(touched, soft), 0.45 * speed * max(SHORTEST_S, 0.45 * speed)), rel=0.01
    )


@pytest.mark.parametrize("speed", ALL_SPEEDS)
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.9])
def test_adaptive_stays_within_the_vehicles_acceleration_and_is_continuous(speed, restitution):
    touched = hit(speed, 0.5)
    _, way = adaptive(touched, rebound(touched, restitution), acceleration_m_s2=3.0)
    before = way.at(0.0)
    assert before.velocity_ned_m_s == pytest.approx(rebound(touched, restitution).velocity_ned_m_s)
    for time_s in times_of(way)[1:-1]:
        motion = way.at(time_s)
        assert math.hypot(*motion.acceleration_ned_m_s2) <= 3.0 * 1.02
        step_s = way.duration_s / 200
        moved = math.dist(motion.position_ned_m, before.position_ned_m)
        assert (
            moved
            <= 1.1 * step_s * max(math.hypot(*motion.velocity_ned_m_s), math.hypot(*before.velocity_ned_m_s)) + 1e-6
        )
        before = motion


@pytest.mark.parametrize("name", ["adaptive", "normal"])
@pytest.mark.parametrize("tangential", ["damped", "kept"])
def test_turning_or_mirroring_the_world_turns_or_mirrors_the_recovery(name, tangential):
    law = RECOVERY_LAWS[name](RecoveryConfig(tangential=tangential))
    touched = Contact(0, (0.0, 0.0, -2.0), (1.7, 0.4, 0.1), turned((-1.0, 0.0, 0.0), 0.4))
    motion = rebound(touched, 0.3)
    goal = law.goal_ned_m(touched, motion)
    at = law.way(motion, goal).at(0.3).position_ned_m
    for change in (lambda v: turned(v, 1.234), mirrored):
        other = Contact(0, *(change(v) for v in (touched.position_ned_m, touched.velocity_ned_m_s, touched.normal_ned)))
        moving = Moving(change(motion.position_ned_m), change(motion.velocity_ned_m_s))
        other_goal = law.goal_ned_m(other, moving)
        assert other_goal == pytest.approx(change(goal))
        assert law.way(moving, other_goal).at(0.3).position_ned_m == pytest.approx(change(at))


def test_normal_goes_back_along_the_normal_and_keeps_or_damps_the_rest():
    touched = hit(2.0, math.radians(60))
    damped, kept = (NormalLaw(RecoveryConfig(gamma=0.5, tangential=how)) for how in ("damped", "kept"))
    # 2 m/s at 60 degrees from the normal: 1 m/s into the wall, 1.73 along it
    goal = damped.goal_ned_m(touched, damped.expected(touched))
    assert off_m(touched, goal) == pytest.approx(0.5)
    assert math.dist(goal, AT) == pytest.approx(0.5)
    on = kept.goal_ned_m(touched, kept.expected(touched))
    assert off_m(touched, on) == pytest.approx(0.5)
    assert math.dist(on, goal) == pytest.approx(0.5 * math.sqrt(3))


def test_along_the_wall_adaptive_comes_to_rest_where_the_motion_along_it_ends():
    touched = hit(2.0, math.radians(60))
    goal, _ = adaptive(touched, rebound(touched, 0.2))
    along_m = 0.5 * math.sqrt(3) * SHORTEST_S
    assert off_m(touched, goal) == pytest.approx(0.35 + 0.17 * along_m, abs=0.01), "the normal may be 10 degrees wrong"
    beside_m = math.sqrt(math.dist(goal, AT) ** 2 - off_m(touched, goal) ** 2)
    assert beside_m == pytest.approx(along_m, rel=0.05), "half of v_t times the shortest duration"


def test_a_hovering_vehicle_that_is_struck_gives_way():
    struck = Contact(0, AT, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    goal, _ = adaptive(struck, Moving((4.0, -1.95, -1.5), (0.0, 0.45, 0.0)))
    assert goal[:2] == pytest.approx((4.0, -1.65)), "0.35 m from where it was struck, more than it takes to stop"


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


ROOM = Envelope((0.0, 0.0, 0.0), Fence(radius_m=6.0, max_height_m=3.0, min_height_m=0.4))


def test_from_a_ceiling_the_way_leads_down_but_never_into_the_floor():
    under = Contact(0, (0.0, 0.0, -2.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    goal, _ = adaptive(under, rebound(under, 0.2))
    assert goal == pytest.approx((0.0, 0.0, -1.65))
    low = Contact(0, (0.0, 0.0, -0.6), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    goal, _ = adaptive(low, rebound(low, 0.2))
    assert Room(ROOM).goal(low.position_ned_m, low.normal_ned, goal) == pytest.approx((0.0, 0.0, -0.4))


def test_the_fence_stops_a_recovery_and_the_brakes_are_what_that_takes():
    touched = Contact(0, (5.5, 0.0, -1.5), (-5.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    law = AdaptiveLaw(RecoveryConfig())
    motion = rebound(touched, 0.5)
    goal = Room(ROOM).goal(touched.position_ned_m, touched.normal_ned, law.goal_ned_m(touched, motion))
    assert goal[0] == pytest.approx(6.0)
    way = law.way(motion, goal)
    assert max(way.at(time_s).position_ned_m[0] for time_s in times_of(way)) <= 6.0 + 1e-9


NORTH_WALL = Surface((3.0, 2.0, -1.5), (-1.0, 0.0, 0.0), 0.5)


def test_out_of_a_corner_the_goal_is_clear_of_both_walls():
    """Leaving the north wall when the east wall is hit: eq. 3 alone leads back into the first."""
    east_wall = Contact(0, (2.7, 2.8, -1.5), (-0.4, 1.4, 0.0), (0.0, -1.0, 0.0))
    law = RECOVERY_LAWS["paper"](RecoveryConfig())
    alone = law.goal_ned_m(east_wall, law.expected(east_wall))
    assert alone[0] > 2.7
    goal = Room(ROOM, (NORTH_WALL,)).goal(east_wall.position_ned_m, east_wall.normal_ned, alone)
    assert goal == pytest.approx((2.5, alone[1], -1.5))
    further = (1.0, 2.0, -1.5)
    assert Room(ROOM, (NORTH_WALL,)).goal(east_wall.position_ned_m, east_wall.normal_ned, further) == further


def test_a_surface_that_the_vehicle_is_behind_is_not_there():
    """Of a wall that was brushed the normal was 70 degrees wrong, and the vehicle flew on along it, behind that."""
    brushed = Surface((3.0, 2.0, -1.5), (-1.0, 0.0, 0.0), 0.5)
    # Given a hit on the same wall half a metre behind that surface, and a goal off the wall
    hit = Contact(0, (3.5, 4.0, -1.5), (0.5, 0.9, 0.0), (0.34, -0.94, 0.0))
    wanted = (3.6, 3.7, -1.5)
    # Then it is not moved through where the vehicle is, back into the wall
    assert Room(ROOM, (brushed,)).goal(hit.position_ned_m, hit.normal_ned, wanted) == wanted
    # but a touch that lies a decimetre deeper than the surface is the estimate's
    assert Room(ROOM, (brushed,)).goal((3.1, 4.0, -1.5), hit.normal_ned, wanted)[0] == pytest.approx(2.5)


@pytest.mark.parametrize(("gap_m", "north_m"), [(3.0, 1.0), (1.2, 2.5), (0.6, 2.7)])
def test_between_walls_that_face_each_other_the_goal_stays_between(gap_m, north_m):
    """The south wall is touched `gap_m` south of where the north wall was; away from it is towards the north wall."""
    south = Contact(0, (3.0 - gap_m, 2.0, -1.5), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    wanted = (4.0 - gap_m, 2.0, -1.5)
    goal = Room(ROOM, (NORTH_WALL,)).goal(south.position_ned_m, south.normal_ned, wanted)
    assert goal[0] == pytest.approx(min(wanted[0], north_m), abs=1e-9)


def test_a_glide_that_is_too_short_for_its_speed_brakes_harder_and_does_not_run_past():
    way = glide((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.4, 0.0, 0.0), 3.0)
    assert max(way.at(time_s).position_ned_m[0] for time_s in times_of(way)) <= 0.4 + 1e-9


def test_a_glide_goes_on_with_the_lean_that_there_is_and_takes_it_back():
    way = glide((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (4.0, 0.0, 0.0), (1.2, 0.0, 0.0), 3.0)
    total_s, step_s = way.duration_s, 1e-4
    x = [way.at(time_s).position_ned_m[0] for time_s in (0.0, step_s, 2.0 * step_s)]
    assert (x[1] - x[0]) / step_s == pytest.approx(0.2, abs=1e-3)
    assert (x[2] - 2.0 * x[1] + x[0]) / step_s**2 == pytest.approx(4.0, abs=0.05)
    at_last = way.at(total_s - 1e-6)
    assert at_last.position_ned_m[0] == pytest.approx(1.2)
    assert at_last.velocity_ned_m_s[0] == pytest.approx(0.0, abs=1e-6)
    # its velocity is what its places change by
    for time_s in times_of(way)[1:-1:20]:
        a, b = (way.at(time_s + side * step_s).position_ned_m[0] for side in (-1.0, 1.0))
        assert (b - a) / (2.0 * step_s) == pytest.approx(way.at(time_s).velocity_ned_m_s[0], abs=1e-4)


def test_where_a_leant_vehicle_comes_to_rest_is_asked_for():
    # Given one that stands where it touched, leant away: taking the lean back carries it off by a T^2 / 12
    leant = Moving(AT, (0.0, 0.0, 0.0), (-6.0, 0.0, 0.0))
    goal, way = adaptive(hit(1.0), leant)
    assert off_m(hit(1.0), goal) == pytest.approx(6.0 * way.duration_s**2 / 12.0, rel=1e-6)


@pytest.mark.parametrize("leant_m_s2", [9.0, 40.0, 1e3])
@pytest.mark.parametrize("most_m_s2", [0.5, 3.0])
def test_what_shows_more_lean_than_a_way_can_take_back_still_ends_near_by(leant_m_s2, most_m_s2):
    # Given a push that goes on, taken for a lean
    goal, way = adaptive(hit(1.0), Moving(AT, (-1.0, 0.3, 0.0), (-leant_m_s2, 0.0, 0.0)), acceleration_m_s2=most_m_s2)
    assert off_m(hit(1.0), goal) < 8.0 / most_m_s2
    assert max(math.dist(way.at(time_s).position_ned_m, AT) for time_s in times_of(way)) < 8.0 / most_m_s2


def flown_past_m(duration_s, start_m_s, goal_m, answer=damped):
    """How far a vehicle with PX4's default gains runs past the goal of a glide, m; its thrust turns by a critically
    damped 12 rad/s, its estimate and link are 35 ms late, and drag is what it is not trimmed for."""
    way = Glide((0.0, 0.0, 0.0), (start_m_s, 0.0, 0.0), (0.0, 0.0, 0.0), (goal_m, 0.0, 0.0), duration_s)
    step_s, position_p, velocity_p, velocity_i, velocity_d, drag_per_s = 0.005, 0.95, 1.8, 0.4, 0.2, 0.17
    late = [0.0] * round(0.035 / step_s)
    x = lean = turning = integral = acceleration = past_m = 0.0
    v = start_m_s
    for step in range(round(3.5 / step_s)):
        asked = way.at(step * step_s)
        wanted_m_s = (asked.velocity_ned_m_s or (0.0,))[0] + position_p * (asked.position_ned_m[0] - x)
        integral += velocity_i * (wanted_m_s - v) * step_s
        ahead = (answer(asked) or (0.0,))[0]
        late.append(ahead + velocity_p * (wanted_m_s - v) + integral - velocity_d * acceleration)
        turning += step_s * (144.0 * (late.pop(0) - lean) - 24.0 * turning)
        lean += step_s * turning
        acceleration = lean - drag_per_s * v
        v += step_s * acceleration
        x += step_s * v
        past_m = max(past_m, x - goal_m)
    return past_m


def test_no_way_is_so_short_that_the_vehicle_cannot_lean_both_ways_in_it():
    """The slowest hits ask for the shortest ways: from rest at the obstacle to where the guards are clear of it."""
    assert flown_past_m(SHORTEST_S, 0.0, 0.35) < 0.025
    assert flown_past_m(0.8 * SHORTEST_S, 0.0, 0.35) > 0.03, "a fifth shorter"


def test_what_a_velocity_loop_takes_back_of_the_acceleration_is_sent_on_top():
    def as_it_is(motion):
        return motion.acceleration_ned_m_s2

    assert flown_past_m(SHORTEST_S, 0.8, 0.5) < 0.015
    assert flown_past_m(SHORTEST_S, 0.8, 0.5, as_it_is) > 0.03


def sample(velocity, position=AT):
    return LocalPosition(80_000, position, velocity)


@pytest.mark.parametrize(
    ("moving", "impulse_m_s", "believed"),
    [
        (sample((-0.5, 0.1, 0.0)), 2.5, True),
        (sample((-2.0, 0.0, 0.0)), 2.5, True),  # as stiff as can be
        (sample((-4.0, 0.0, 0.0)), 2.5, False),  # faster off than on
        (sample((0.0, 5.0, 0.0)), 2.5, False),
        (sample((-0.5, 0.0, 0.0), (4.0, 3.0, -1.5)), 2.5, False),  # a position that jumped
    ],
)
def test_a_rebound_that_the_hit_cannot_have_caused_is_not_believed(moving, impulse_m_s, believed):
    assert (believable(moving, hit(2.0), impulse_m_s, 0.08) is not None) is believed


def test_what_has_slid_off_an_obstacle_goes_on_past_it_and_what_leans_on_it_does_not():
    touched, ended_us = hit(2.0), 20_000
    flies_on, leaves, leans, late = ((1.2, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.2, 0.0, 0.0), 40_000)
    assert is_free(sample(flies_on), touched, ended_us)
    assert is_free(sample(leaves), touched, ended_us)
    assert not is_free(sample(leans), touched, ended_us)
    assert not is_free(sample(flies_on), touched, late), "its last push is not yet in the estimate"
    # Given the accelerometer's sum of a vehicle that slows down with 3 m/s^2
    fixes = [VelocityFix(t, flies_on, (-3e-6 * t, 0.0, -9.0), (0.0, 0.0, 0.0)) for t in range(0, 90_000, 10_000)]
    lean = lean_left(fixes, 80_000)
    assert lean == pytest.approx((-3.0, 0.0, 0.0))
    assert lean_left((), 80_000) == (0.0, 0.0, 0.0)
    free = believable(sample(flies_on), touched, 2.0, 0.08, lean)
    assert (free.velocity_ned_m_s, free.acceleration_ned_m_s2) == (flies_on, lean)
    assert believable(sample(flies_on), touched, 2.0, 0.08).velocity_ned_m_s == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("pushed", "after", "normal"),
    [
        (
            (-0.94, 0.34, 0.0),
            (-0.5, 0.0, 0.0),
            (-0.94, 0.34, 0.0),
        ),  # 20 degrees beside the change: friction may be that
        ((0.0, 1.0, 0.0), (-0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),  # a sample gone wrong
        ((0.0, 1.0, 0.0), (1.9, 0.3, 0.0), (0.0, 1.0, 0.0)),  # a graze: the change says little
    ],
)
def test_the_normal_is_the_pushs_unless_the_velocity_says_otherwise(pushed, after, normal):
    assert agreed_normal(pushed, (2.0, 0.0, 0.0), after) == pytest.approx(normal)
