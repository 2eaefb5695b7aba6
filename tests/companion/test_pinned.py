"""Hanging on what was hit: when a vehicle does, until when, and what is asked for meanwhile."""

import math

import pytest

from companion.core import FlightCore
from companion.flight.collision import CollisionRecord
from companion.flight.hearing import hear
from companion.flight.pinned import BEGUN_US, LONGEST_US, Hanging, has_room_below, let_go
from companion.messages import Attitude, Heartbeat, LocalPosition
from companion.mission.config import GuardsConfig
from companion.mission.model import Mission
from companion.recovery.climb import Climb
from companion.recovery.interface import Contact

WALL_IN_THE_NORTH = (-1.0, 0.0, 0.0)


def leaning_north(lean_deg, forward_rad_s=0.0):
    """Nose north; a forward pitch is negative."""
    half = -0.5 * math.radians(lean_deg)
    return Attitude(0, (math.cos(half), 0.0, math.sin(half), 0.0), (0.0, -forward_rad_s, 0.0))


@pytest.mark.parametrize(
    ("lean_deg", "forward_rad_s", "since_hit_us", "hangs"),
    [
        (10.0, 0.0, 20_000, False),  # as it came
        (30.0, 0.0, 60_000, True),
        (10.0, 5.0, 20_000, True),  # on its way there
        (30.0, -5.0, 60_000, False),  # on its way back
        (-30.0, 0.0, 60_000, False),  # away from the wall
        (30.0, 0.0, BEGUN_US, False),  # braking
    ],
)
def test_a_vehicle_hangs_that_leans_into_what_it_has_just_hit(lean_deg, forward_rad_s, since_hit_us, hangs):
    attitude = leaning_north(lean_deg, forward_rad_s)
    assert Hanging().step(attitude, WALL_IN_THE_NORTH, since_hit_us, 1_000_000) is hangs


def test_it_hangs_until_it_is_nearly_level_or_for_too_long():
    hanging = Hanging()
    assert hanging.step(leaning_north(30.0), WALL_IN_THE_NORTH, 60_000, 1_000_000)
    assert hanging.step(leaning_north(15.0), WALL_IN_THE_NORTH, 400_000, 1_340_000)
    assert not hanging.step(leaning_north(11.0), WALL_IN_THE_NORTH, 420_000, 1_360_000)
    assert hanging.step(leaning_north(30.0), WALL_IN_THE_NORTH, 60_000, 2_000_000)
    assert not hanging.step(leaning_north(70.0), WALL_IN_THE_NORTH, 1_200_000, 2_000_001 + LONGEST_US)


def test_little_thrust_away_from_the_wall_is_asked_for_and_its_height_of_what_does_not_lean_yet():
    # Given a hit that the estimate does not know, and that has made the vehicle fall with 0.05 m/s
    climb = Climb(1_000_000, 998_000, (2.0, 0.0, 0.0), GuardsConfig(), 3.0, speed_m_s=0.05)
    contact = Contact(1_000_000, (3.0, 0.0, -2.0), (2.0, 0.0, 0.0), WALL_IN_THE_NORTH)
    record = CollisionRecord(0, 1_000_000, "d", contact, (2.0, 0.0, -2.0), WALL_IN_THE_NORTH, 9.0, 1_000_000, climb)
    wanted = [(falls, reckons) for falls in (True, False) for reckons in (True, False)]
    asked = {each: let_go(record, WALL_IN_THE_NORTH, None, *each) for each in wanted}
    assert all(target.acceleration_ned_m_s2[0] < -3.0 and target.leans_only for target in asked.values())
    # Then one that hangs falls, and one that is about to is held as reckoned, or at the setpoint's height
    assert 0.0 < asked[True, True].acceleration_ned_m_s2[2] == asked[True, False].acceleration_ned_m_s2[2] < 9.81
    assert asked[False, True].acceleration_ned_m_s2[2] < 0.0 and asked[False, True].is_height_free
    assert asked[False, False].acceleration_ned_m_s2[2] == 0.0 and not asked[False, False].is_height_free


def test_what_is_about_to_hang_does_not_lean_yet():
    hanging = Hanging()
    assert hanging.step(leaning_north(10.0, 5.0), WALL_IN_THE_NORTH, 20_000, 1_000_000) and not hanging.is_leant
    assert hanging.step(leaning_north(25.0, 2.0), WALL_IN_THE_NORTH, 60_000, 1_040_000) and hanging.is_leant


@pytest.mark.parametrize(
    ("height_m", "down_m_s", "has_room"),
    [(1.0, 0.0, True), (1.0, 1.5, True), (1.0, 2.0, False), (3.0, 2.0, True), (0.25, 0.0, False), (0.5, -2.0, True)],
)
def test_a_vehicle_falls_only_as_far_as_it_can_be_stopped(height_m, down_m_s, has_room):
    flight = FlightCore(
        Mission.model_validate({"name": "m", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]}), 0
    ).flight
    flight.origin_ned_m = (0.0, 0.0, -0.1)
    assert not has_room_below(flight), "nothing is known of the height"
    hear(flight, [Heartbeat(1, 1, 2, 12, True, 0, 3)], 0)
    hear(flight, [LocalPosition(1_000, (0.0, 0.0, -0.1 - height_m), (0.0, 0.0, down_m_s))], 1_000)
    assert has_room_below(flight) is has_room
