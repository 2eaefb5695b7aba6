"""Hanging on what was hit: a vehicle that is pressed to it by its own thrust is let fall, where there is room."""

import math

import pytest

from companion.estimate.strapdown import GRAVITY_M_S2
from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, Inputs, Target
from companion.flight.recovering import Recover
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import LocalPosition
from companion.mission.config import EstimateConfig
from companion.mission.model import Mission
from companion.reflex.config import FALLS_M_S2
from companion.reflex.laws import Contact
from companion.reflex.reckoning import Reckoning

HIT_US, SINCE_US = 1_000_000, 100_000
MISSION = {"name": "m", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]}


def asked(lean_deg: float, height_m: float = 2.0, down_m_s: float = 0.0) -> Target:
    """Of a vehicle at a wall in the north that has just been hit, and leans towards it by so much."""
    mission = Mission.model_validate(MISSION)
    flight = FlightContext(mission, Vehicle(), StreamMonitor(mission.companion.streams))
    flight.origin_ned_m = (0.0, 0.0, 0.0)
    contact = Contact(HIT_US, (3.0, 0.0, -height_m), (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    reckoning = Reckoning(contact, HIT_US, contact.rebound(0.0), EstimateConfig())
    goal = (2.6, 0.0, -height_m)
    flight.collisions.append(
        CollisionRecord(0, HIT_US, "fused", contact, goal, contact.normal_ned, 20.0, HIT_US, reckoning)
    )
    recover = Recover(flight, 0)
    reckoning.lean_m_s2 = (GRAVITY_M_S2 * math.tan(math.radians(lean_deg)), 0.0, 0.0)
    sample = LocalPosition(HIT_US + SINCE_US, contact.position_ned_m, (0.0, 0.0, down_m_s))
    flight.vehicle.history.add(sample)
    recover.step(flight, Inputs(positions=[sample]), SINCE_US)
    target = recover.target(SINCE_US)
    assert target is not None
    return target


@pytest.mark.parametrize(("lean_deg", "hangs"), [(10.0, False), (30.0, True), (-30.0, False)])
def test_a_vehicle_hangs_that_leans_into_what_it_touches(lean_deg, hangs):
    target = asked(lean_deg)
    assert target.acceleration_ned_m_s2 is not None
    assert (target.acceleration_ned_m_s2[2] == FALLS_M_S2) is hangs
    if hangs:
        # Nothing but accelerations: its thrust is to press less, and away from the wall.
        assert target.leans_only and target.is_height_free
        assert target.acceleration_ned_m_s2[0] < 0.0


@pytest.mark.parametrize(
    ("height_m", "down_m_s", "falls"),
    [(1.0, 0.0, True), (1.0, 1.5, True), (1.0, 2.0, False), (3.0, 2.0, True), (0.25, 0.0, False), (0.5, -2.0, True)],
)
def test_a_vehicle_falls_only_as_far_as_it_can_be_stopped(height_m, down_m_s, falls):
    target = asked(30.0, height_m, down_m_s)
    assert target.acceleration_ned_m_s2 is not None
    assert (target.acceleration_ned_m_s2[2] == FALLS_M_S2) is falls
