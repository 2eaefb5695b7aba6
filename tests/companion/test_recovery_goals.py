"""Where a recovery comes to rest: by each law, clear of all surfaces, inside the fence, the same in every direction."""

import math

import pytest

from companion.fence import Fence
from companion.flight.obstacle_map import inside_fence
from companion.motion.vector import ZERO
from companion.reflex.config import WAY_S, RecoveryConfig
from companion.reflex.laws import RECOVERY_LAWS, Contact
from companion.reflex.surface import Surface, projected

AT, SOUTH = (4.0, -2.0, -1.5), (-1.0, 0.0, 0.0)
ALL_SPEEDS = (0.5, 1.0, 2.0, 3.5, 5.0)


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


def goal_of(name, touched, motion=None, **config):
    settings = RecoveryConfig(law=name, **config)
    motion = motion or touched.rebound(settings.restitution)
    return RECOVERY_LAWS[name].goal_ned_m(settings, touched, motion)


# --- goals


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
    assert goal_of("paper", Contact(0, AT, ZERO, SOUTH)) == AT, "hit while hovering: stay"


def test_normal_goes_back_along_the_normal_and_keeps_or_damps_the_rest():
    # 2 m/s at 60 degrees from the normal: 1 m/s into the wall, 1.73 along it
    touched = hit(2.0, math.radians(60))
    goal, on = (goal_of("normal", touched, tangential=how) for how in ("damped", "kept"))
    assert off_m(touched, goal) == pytest.approx(0.5) and math.dist(goal, AT) == pytest.approx(0.5)
    assert off_m(touched, on) == pytest.approx(0.5) and math.dist(on, goal) == pytest.approx(0.5 * math.sqrt(3))


@pytest.mark.parametrize("speed", ALL_SPEEDS)
def test_adaptive_keeps_the_guards_clear_by_the_distance_asked_for(speed):
    touched = hit(speed)
    soft = goal_of("adaptive", touched, touched.rebound(0.0))
    assert off_m(touched, soft) == pytest.approx(0.35)
    assert soft[2] == AT[2], "height is held"
    # a stiff airframe that needs more room to stop gets it
    stiff = goal_of("adaptive", touched, touched.rebound(0.9))
    assert off_m(touched, stiff) == pytest.approx(max(0.35, 0.9 * speed * WAY_S))


@pytest.mark.parametrize("name", ["adaptive", "normal"])
@pytest.mark.parametrize("tangential", ["damped", "kept"])
def test_turning_or_mirroring_the_world_turns_or_mirrors_the_recovery(name, tangential):
    touched = Contact(0, (0.0, 0.0, -2.0), (1.7, 0.4, 0.1), turned(SOUTH, 0.4))
    goal = goal_of(name, touched, touched.rebound(0.3), tangential=tangential)
    for change in (lambda v: turned(v, 1.234), mirrored):
        other = Contact(0, *(change(v) for v in (touched.position_ned_m, touched.velocity_ned_m_s, touched.normal_ned)))
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


def in_room(surfaces, contact_m, goal_m):
    goal_m = projected(goal_m, [(surface.normal_ned, surface.level_m) for surface in surfaces])
    return inside_fence(ROOM, ZERO, contact_m, goal_m)


def test_from_a_ceiling_the_way_leads_down_but_never_into_the_floor():
    under = Contact(0, (0.0, 0.0, -2.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    assert goal_of("adaptive", under) == pytest.approx((0.0, 0.0, -1.65))
    low = Contact(0, (0.0, 0.0, -0.6), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
    goal = goal_of("adaptive", low)
    assert in_room((), low.position_ned_m, goal) == pytest.approx((0.0, 0.0, -0.4))
