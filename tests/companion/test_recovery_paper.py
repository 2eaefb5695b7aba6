"""Eq. 3: back along the approach on each horizontal axis, height kept, inside the fence."""

import math

import pytest

from companion.mission.fence import Fence
from companion.recovery.envelope import Envelope, away_from_both
from companion.recovery.interface import Contact, RecoveryConfig
from companion.recovery.paper import PaperLaw


def contact(velocity, position=(4.0, -2.0, -1.5)):
    return Contact(0, position, velocity, (-1.0, 0.0, 0.0))


@pytest.mark.parametrize("north", [2.0, -2.0])
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_the_setpoint_lies_back_along_the_approach_in_every_quadrant(north, east):
    setpoint = PaperLaw(RecoveryConfig(gamma=(0.5, 0.25))).setpoint_ned_m(contact((north, east, 0.7)))

    assert (setpoint[0] - 4.0) / -north == pytest.approx(0.5), "gamma_1 |v_c1|, against the approach"
    assert (setpoint[1] + 2.0) / -east == pytest.approx(0.25), "gamma_2 |v_c2|, against the approach"
    assert setpoint[2] == -1.5, "height kept, climb or not"


def test_the_papers_own_numbers():
    """v_c = 2.1 m/s and gamma = 0.5 from x(t_c) = [0.6, 0, -0.5] give x_d = [-0.45, 0, -0.5]."""
    setpoint = PaperLaw(RecoveryConfig(gamma=0.5)).setpoint_ned_m(contact((2.1, 0.0, 0.0), (0.6, 0.0, -0.5)))
    assert setpoint == pytest.approx((-0.45, 0.0, -0.5))


def test_hit_while_hovering_asks_to_stay():
    assert PaperLaw(RecoveryConfig()).setpoint_ned_m(contact((0.0, 0.0, 0.0))) == (4.0, -2.0, -1.5)


FENCE = Envelope((10.0, 0.0, 2.0), Fence(radius_m=5.0, max_height_m=6.0))


def test_a_setpoint_inside_the_fence_is_left_alone():
    assert FENCE.clamp((12.0, 0.0, 0.0), (11.0, 1.0, 0.0)) == (11.0, 1.0, 0.0)


def test_the_way_back_is_shortened_at_the_fence_not_bent():
    start, wish = (10.0, 3.0, 0.0), (18.0, 3.0, 0.0)
    clamped = FENCE.clamp(start, wish)
    assert math.hypot(clamped[0] - 10.0, clamped[1]) == pytest.approx(5.0)
    assert clamped[1] == pytest.approx(3.0), "still on the line from the contact to the wish"
    assert clamped == pytest.approx((14.0, 3.0, 0.0))


def test_a_contact_outside_the_fence_is_answered_with_the_nearest_place_inside():
    clamped = FENCE.clamp((17.0, 0.0, 0.0), (19.0, 0.0, 0.0))
    assert clamped == pytest.approx((15.0, 0.0, 0.0))


def test_height_is_limited_from_the_arming_position():
    assert FENCE.clamp((10.0, 0.0, -5.0), (10.0, 0.0, -5.0))[2] == -4.0


NORTH_WALL, EAST_WALL = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)


def test_in_a_corner_the_second_setpoint_leads_out_of_both_walls():
    """Leaving the north wall at 0.4 m/s when the east wall is hit at 1.4: back along the approach is north again."""
    first = (2.0, 2.1, -1.5)
    law = PaperLaw(RecoveryConfig(gamma=0.5))
    second = law.setpoint_ned_m(Contact(0, (2.7, 2.8, -1.5), (-0.4, 1.4, 0.0), EAST_WALL))
    assert second[0] > 2.7, "alone, it would lead back into the north wall"

    assert away_from_both(second, EAST_WALL, first, NORTH_WALL) == pytest.approx((2.0, 2.1, -1.5))


def test_a_setpoint_that_is_far_enough_from_the_first_wall_stays():
    assert away_from_both((1.0, 2.0, -1.5), EAST_WALL, (1.5, 2.0, -1.5), NORTH_WALL) == (1.0, 2.0, -1.5)


def test_between_walls_that_face_each_other_only_the_last_hit_counts():
    south_wall = (1.0, 0.0, 0.0)
    assert away_from_both((1.0, 0.0, -1.5), south_wall, (0.2, 0.0, -1.5), NORTH_WALL) == (1.0, 0.0, -1.5)
