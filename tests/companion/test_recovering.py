"""What a recovery asks of a vehicle that hangs on what it hit, beside its plan."""

import math
from dataclasses import replace

import pytest

from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, Inputs, Target
from companion.flight.recovering import Recover
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import Attitude, LocalPosition, Vector3
from companion.mission.model import Mission
from companion.motion.config import GRAVITY_M_S2
from companion.reflex.config import DESCENT_M_S2, EstimateConfig
from companion.reflex.laws import Contact
from companion.reflex.motion_estimator import MotionEstimator
from companion.reflex.normal import Normal

HIT_US, SINCE_US = 1_000_000, 100_000
OFF_M, OFF_M_S, LEVEL_LEANS_M_S2 = (0.3, -0.2, 0.1), (-0.1, 0.05, 0.0), (0.5, 0.4, 0.0)
MISSION = {"name": "m", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]}


def leans_m_s2(lean_deg: float) -> Vector3:
    return (GRAVITY_M_S2 * math.tan(math.radians(lean_deg)), 0.0, 0.0)


def begun(height_m: float, attitude: Attitude | None) -> tuple[Recover, FlightContext, MotionEstimator]:
    mission = Mission.model_validate(MISSION)
    flight = FlightContext(mission, Vehicle(), StreamMonitor(mission.companion.streams))
    flight.origin_ned_m = (0.0, 0.0, 0.0)
    contact = Contact(HIT_US, (3.0, 0.0, -height_m), (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    estimator = MotionEstimator(contact, HIT_US, contact.rebound(0.0), EstimateConfig())
    goal = (2.6, 0.0, -height_m)
    flight.collisions.append(
        CollisionRecord(0, HIT_US, "fused", contact, goal, Normal(contact.normal_ned, 0.2), 20.0, estimator)
    )
    flight.vehicle.attitude = attitude
    return Recover(flight, 0), flight, estimator


def asked(
    lean_deg: float,
    height_m: float = 2.0,
    down_m_s: float = 0.0,
    attitude: Attitude | None = None,
    is_fully_measured: bool = False,
    told_off: bool = False,
    leant_deg: tuple[float, ...] = (),
    off_m_s: float = 0.0,
) -> Target:
    """Of a vehicle at a wall in the north that has just been hit, and leans towards it by so much; before, by other
    angles."""
    recover, flight, estimator = begun(height_m, attitude)
    estimator.note_contact(is_fully_measured, HIT_US)
    sample = LocalPosition(HIT_US + SINCE_US, (3.0, 0.0, -height_m), (-off_m_s, 0.0, down_m_s))
    flight.vehicle.history.add(sample)
    recover.step(flight, Inputs(positions=[sample]), SINCE_US)
    estimator.motion = replace(estimator.motion, velocity_ned_m_s=sample.velocity_ned_m_s)
    if told_off:
        estimator.position_error_m, estimator._hidden_error_m_s = OFF_M, OFF_M_S
        flight.collisions[0].level_acceleration_m_s2 = LEVEL_LEANS_M_S2
    for each_deg in (*leant_deg, lean_deg):
        estimator.tilt_m_s2 = leans_m_s2(each_deg)
        recover.step(flight, Inputs(), SINCE_US)
    target = recover.target(SINCE_US)
    assert target is not None
    return target


@pytest.mark.parametrize(("lean_deg", "hangs"), [(10.0, False), (30.0, True), (-30.0, False)])
def test_a_vehicle_hangs_that_leans_into_what_it_touches(lean_deg, hangs):
    target = asked(lean_deg)
    assert target.acceleration_ned_m_s2 is not None
    assert (target.acceleration_ned_m_s2[2] == DESCENT_M_S2) is hangs
    if hangs:
        # Nothing but accelerations: its thrust is to press less, and away from the wall.
        assert target.acceleration_only and target.is_height_free
        assert target.acceleration_ned_m_s2[0] < 0.0


@pytest.mark.parametrize(
    ("height_m", "down_m_s", "falls"),
    [(1.0, 0.0, True), (1.0, 1.5, True), (1.0, 2.0, False), (3.0, 2.0, True), (0.25, 0.0, False), (0.5, -2.0, True)],
)
def test_a_vehicle_falls_only_as_far_as_it_can_be_stopped(height_m, down_m_s, falls):
    target = asked(30.0, height_m, down_m_s)
    assert target.acceleration_ned_m_s2 is not None
    assert (target.acceleration_ned_m_s2[2] == DESCENT_M_S2) is falls


@pytest.mark.parametrize(
    ("leant_deg", "lean_deg", "hangs"),
    [((), 15.0, True), ((30.0,), 15.0, True), ((30.0,), 13.0, False), ((30.0, -10.0), 10.0, False)],
)
def test_a_vehicle_hangs_until_it_does_not_lean_on_the_obstacle_any_more(leant_deg, lean_deg, hangs):
    target = asked(lean_deg, is_fully_measured=True, leant_deg=leant_deg)
    assert target.acceleration_ned_m_s2 is not None
    assert (target.acceleration_ned_m_s2[2] == DESCENT_M_S2) is hangs


@pytest.mark.parametrize(
    ("leant_deg", "off_m_s", "climbs"), [((), -0.1, True), ((30.0,), -0.1, False), ((30.0,), 0.3, True)]
)
def test_what_has_hung_does_not_climb_before_it_leaves(leant_deg, off_m_s, climbs):
    # Given a vehicle that falls beside the wall, level again
    target = asked(0.0, 3.0, 1.0, is_fully_measured=True, leant_deg=leant_deg, off_m_s=off_m_s)
    assert target.acceleration_ned_m_s2 is not None
    # Then it is braked at once, or, where it hung, when it leaves by more than noise: an overhang is above it
    assert target.acceleration_ned_m_s2[2] == pytest.approx(-3.0 if climbs else 0.0)
    assert target.is_height_free is not climbs


def test_the_surface_goes_along_with_what_hangs_on_it():
    # Given a vehicle that slides down an overhang: at each report it is 0.15 m further in
    mission = Mission.model_validate(MISSION)
    for lean_deg, asks_off in ((30.0, True), (-5.0, False)):
        recover, flight, estimator = begun(5.0, None)
        estimator.note_contact(True, HIT_US)
        for step in range(1, 7):
            place = (3.0 + 0.15 * step, 0.0, -5.0)
            estimator.tilt_m_s2 = leans_m_s2(lean_deg)
            at_us = SINCE_US + 20_000 * step
            recover.step(flight, Inputs(positions=[LocalPosition(HIT_US + at_us, place, (0.5, 0.0, 0.5))]), at_us)
        target = recover.target(at_us)
        assert target is not None and target.acceleration_ned_m_s2 is not None
        # Then it is kept off where it is now. What it only passed counts for nothing.
        hard_m_s2 = 2.0 * mission.recovery.acceleration_m_s2
        assert (target.acceleration_ned_m_s2[0] == pytest.approx(-hard_m_s2)) is asks_off


def less(a, b):
    return tuple(x - y for x, y in zip(a, b, strict=True))


def test_as_much_is_asked_for_beside_the_plan_as_the_told_estimate_is_off_by():
    # Given the same plan, for a vehicle that tells its place and its tilt as they are, and for one that does not
    right, off = asked(-10.0, is_fully_measured=True), asked(-10.0, is_fully_measured=True, told_off=True)
    assert right.acceleration_ned_m_s2 is not None and off.acceleration_ned_m_s2 is not None
    # Then place and velocity are off by as much, and the lean takes back what one gives that takes itself for level
    assert less(off.position_ned_m, right.position_ned_m) == pytest.approx(OFF_M)
    assert less(off.velocity_ned_m_s, right.velocity_ned_m_s) == pytest.approx(OFF_M_S)
    assert less(right.acceleration_ned_m_s2, off.acceleration_ned_m_s2) == pytest.approx(LEVEL_LEANS_M_S2)
