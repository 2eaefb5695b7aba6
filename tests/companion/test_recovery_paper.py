"""Eq. 3: back along the approach on each horizontal axis, height kept, inside the fence."""

import math

import pytest

from companion.mission.fence import Fence
from companion.reflex.halfspace import Envelope
from companion.recovery.interface import Contact, RecoveryConfig
from companion.recovery.paper import PaperLaw


def eq_3(touched, gamma=0.5):
    law = PaperLaw(RecoveryConfig(gamma=gamma))
    return law.goal_ned_m(touched, law.expected(touched))


def contact(velocity, position=(4.0, -2.0, -1.5)):
    return Contact(0, position, velocity, (-1.0, 0.0, 0.0))


@pytest.mark.parametrize("north", [2.0, -2.0])
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_the_setpoint_lies_back_along_the_approach_in_every_quadrant(north, east):
    setpoint = eq_3(contact((north, east, 0.7)), (0.5, 0.25))

    assert (setpoint[0] - 4.0) / -north == pytest.approx(0.5), "gamma_1 |v_c1|, against the approach"
    assert (setpoint[1] + 2.0) / -east == pytest.approx(0.25), "gamma_2 |v_c2|, against the approach"
    assert setpoint[2] == -1.5, "height kept, climb or not"


def test_the_papers_own_numbers():
    """v_c = 2.1 m/s and gamma = 0.5 from x(t_c) = [0.6, 0, -0.5] give x_d = [-0.45, 0, -0.5]."""
    setpoint = eq_3(contact((2.1, 0.0, 0.0), (0.6, 0.0, -0.5)))
    assert setpoint == pytest.approx((-0.45, 0.0, -0.5))


def test_hit_while_hovering_asks_to_stay():
    assert eq_3(contact((0.0, 0.0, 0.0))) == (4.0, -2.0, -1.5)


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


def test_the_setpoint_is_asked_for_at_once_and_never_changed():
    law = PaperLaw(RecoveryConfig())
    touched = contact((2.0, 0.0, 0.0))
    way = law.way(law.expected(touched), (3.0, -2.0, -1.5))
    assert not law.is_refined
    for elapsed_s in (0.0, 0.1, 5.0):
        motion = way.at(elapsed_s)
        assert motion.position_ned_m == (3.0, -2.0, -1.5)
        assert motion.velocity_ned_m_s is None and motion.acceleration_ned_m_s2 is None
