"""A recovery: by attitude until the vehicle rests and the errors of its own estimate are known, then by a position."""

import math
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.companion import Companion
from companion.flight.context import FlightContext, Inputs, Target
from companion.flight.core import Limiter
from companion.flight.envelope import SetpointError
from companion.flight.handlers.ending import early_end
from companion.flight.handlers.recovering import Recover
from companion.flight.obstacle_map import FlightRoom, all_known
from companion.flight.states import State
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.mavlink.encode import Encoder
from companion.messages import Attitude, AttitudeSetpoint, ImuSample, LocalPosition, PositionSetpoint
from companion.mission.model import Mission
from companion.motion.config import GRAVITY_M_S2, SAME_M_S
from companion.motion.doppler import Doppler
from companion.motion.strapdown import LEVEL, Strapdown
from companion.motion.vector import ZERO
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import NOTICED_S, EstimateConfig
from companion.reflex.detection.detector import Impact, ImpactKind
from companion.reflex.recovery.collision import Collision
from companion.reflex.surface import Contact, MotionState, Normal, Surface
from tests.companion.fake_vehicle import flying_in

HIT_US, SOUTH = 1_000_000, (-1.0, 0.0, 0.0)
AT = (3.0, 0.0, -2.0)
MISSION = {"name": "m", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]}


def flight_with(loss_s=0.3, learnt_s=2.0, estimator=None, law="adaptive", north_m_s=2.0, **keys) -> FlightContext:
    """A flight that has just hit a wall in the north, measured whole unless an estimator says otherwise."""
    mission = Mission.model_validate(MISSION | {"recovery": {"law": law}} | keys)
    flight = FlightContext(mission)
    reflex = flight.reflex
    flight.origin_ned_m, reflex.loss_s = (0.0, 0.0, 0.0), loss_s
    flight.vehicle.attitude = reflex.monitor.gate.latest = Attitude(HIT_US, LEVEL)
    thrust = reflex.monitor.state.thrust
    thrust.full_m_s2, thrust.known_s = 16.0, learnt_s
    if estimator is None:
        contact = Contact(AT, (north_m_s, 0.0, 0.0), SOUTH, 0.2)
        estimator = MotionEstimator(contact, HIT_US, contact.rebound(0.45), EstimateConfig())
        estimator.note_contact(True, HIT_US, estimator.normal, 0.0)
    source, reflex.monitor.estimator.followed = reflex.monitor.estimator, [estimator]
    estimator.is_answered = True
    how = reflex.law, mission.recovery, mission.companion.settled
    reflex.newest = Collision(0, "fused", 20.0, source, estimator, *how, FlightRoom(flight))
    flight.collisions.append(reflex.newest)
    return flight


def recover_in(flight: FlightContext, *earlier: Surface) -> Recover:
    reflex, hit = flight.reflex, flight.collisions[-1]
    reflex.newest = flight.collisions[-1] = replace(hit, law=reflex.law, earlier=earlier, keeps_trim=reflex.keeps_trim)
    return Recover(flight, 0)


def hears(
    flight: FlightContext, recover: Recover, since_us: int, north_m: float, north_m_s: float, down_m: float = -2.0
):
    sample = LocalPosition(HIT_US + since_us, (north_m, 0.0, down_m), (north_m_s, 0.0, 0.0))
    source = flight.reflex.monitor.estimator
    source.update(ImuSample(sample.time_boot_us, (0.0, 0.0, -GRAVITY_M_S2), ZERO))
    source.update(sample)
    recover.step(flight, Inputs(positions=[sample]), since_us)
    target = recover.target(flight, since_us)
    assert target is not None
    return target, target.setpoint(0)


def test_a_collision_that_nobody_answers_leaves_the_recovery_its_belief_until_both_are_long_past():
    flight = flight_with()
    recover, source = recover_in(flight), flight.reflex.monitor.estimator
    source.begin(Impact(HIT_US + 20_000, HIT_US + 16_000, (0.0, 0.0, -50.0), ImpactKind.CRASH))
    for since_us in range(40_000, 400_000, 20_000):
        hears(flight, recover, since_us, 2.0, 0.0)
    assert flight.collisions[-1].estimator.motion.position_ned_m[0] == pytest.approx(2.0, abs=0.05)
    for later_us in (13_000_000, 13_004_000):
        source.update(ImuSample(HIT_US + later_us, (0.0, 0.0, -GRAVITY_M_S2), ZERO))
    assert source.after is None


def test_it_is_flown_by_attitude_until_it_rests_and_then_by_the_place_where_it_does():
    flight = flight_with()
    recover, kinds = recover_in(flight), []
    for since_us in range(100_000, 1_600_000, 20_000):
        left = math.exp(-since_us / 0.2e6)
        _, sent = hears(flight, recover, since_us, 2.4 + 0.2 * left, -1.0 * left)
        kinds.append(type(sent))
    # Then the kind changes once, at a place that the vehicle is at
    change = kinds.index(PositionSetpoint)
    assert set(kinds[:change]) == {AttitudeSetpoint} and set(kinds[change:]) == {PositionSetpoint}
    assert 0.3 < 0.1 + 0.02 * change < 0.7, "|v| < 0.2 m/s for 0.1 s"
    assert sent.position_ned_m == pytest.approx((2.4, 0.0, -2.0), abs=0.05)
    assert [event.kind for event in flight.events].count("hand_over") == 1


def test_who_has_passed_the_end_of_an_obstacle_is_neither_driven_back_before_it_nor_pressed_to_it():
    flight = flight_with()
    recover = recover_in(flight)
    for since_us in range(100_000, 900_000, 20_000):
        # Past a pole's middle and on, at 1 m/s: there is no wall there
        hears(flight, recover, since_us, 3.3 + 1e-6 * since_us, 1.0)
    record = flight.collisions[-1]
    assert record.setpoint_ned_m[0] > 4.1
    assert not flight.reflex.newest.is_pressed
    # But where it is touched again it is there again
    record.estimator.note_contact(True, HIT_US + 900_000, record.estimator.normal, 0.0)
    for since_us in (900_000, 1_000_000):
        hears(flight, recover, since_us, 4.2, 0.0)
    assert record.setpoint_ned_m[0] == pytest.approx(4.2 - 0.35, abs=0.05)
    assert flight.reflex.newest.is_pressed
    # And who hovers just off it, as in a gap, has left it
    for since_us in range(1_100_000, 1_500_000, 20_000):
        hears(flight, recover, since_us, 4.15, -0.1)
    assert not flight.reflex.newest.is_pressed


@pytest.mark.parametrize("law", ["normal", "paper"])
def test_the_papers_goal_is_as_near_to_what_was_hit_as_eq_3_says(law):
    flight = flight_with(law=law, north_m_s=0.4)
    recover_in(flight)
    assert flight.collisions[-1].setpoint_ned_m == pytest.approx((AT[0] - 0.5 * 0.4, *AT[1:]))


@pytest.mark.parametrize("law", ["adaptive", "normal", "paper"])
def test_every_law_rests_clear_of_a_ceiling_also_where_it_was_met_slowly(law):
    contact = Contact(AT, (0.0, 0.0, -0.4), (0.0, 0.0, 1.0), 0.2)
    flight = flight_with(law=law, estimator=MotionEstimator(contact, HIT_US, contact.rebound(0.45), EstimateConfig()))
    recover_in(flight)
    assert flight.collisions[-1].setpoint_ned_m == pytest.approx((*AT[:2], AT[2] + 0.35), abs=0.02)


@pytest.mark.parametrize(
    ("law", "fallen_m", "climbs_m"), [("adaptive", 0.2, 0.2), ("adaptive", 0.8, 0.35), ("normal", 0.8, 0.8)]
)
def test_after_a_fall_it_climbs_back_by_its_clearance_at_most_and_by_eq_3_all_of_it(law, fallen_m, climbs_m):
    flight = flight_with(law=law)
    recover = recover_in(flight)
    hears(flight, recover, 100_000, 2.8, -0.5, -2.0 + fallen_m)
    # Then the place to rest at stays, also where the vehicle rises again
    hears(flight, recover, 120_000, 2.8, -0.5, -2.0 + fallen_m - 0.1)
    assert flight.collisions[-1].setpoint_ned_m[2] == pytest.approx(-2.0 + fallen_m - climbs_m, abs=1e-6)


@pytest.mark.parametrize(("keeps_trim", "rests_us"), [(False, 100_000), (True, 500_000)])
def test_a_recovery_is_over_once_it_has_stayed_by_a_position_and_counts_from_when_it_rested(keeps_trim, rests_us):
    # Given a vehicle that rests, clear of the obstacle, from the first report on
    flight, handed_us, over_us = flight_with(), 0, 0
    flight.reflex.keeps_trim = keeps_trim
    recover, record = recover_in(flight), flight.collisions[0]
    for since_us in range(100_000, 1_600_000, 20_000):
        _, sent = hears(flight, recover, since_us, 2.4, 0.0)
        handed_us = handed_us or (since_us if type(sent) is PositionSetpoint else 0)
        over_us = over_us or (since_us if record.settled_after_s is not None else 0)
    assert handed_us == 100_000 + rests_us and over_us == handed_us + 500_000
    assert record.settled_after_s == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("after_ned_m_s", "direction_ned"),
    [
        ((-1.0, 0.0, 0.0), (-0.97, -0.26, 0.0)),  # the change is south, the force was south-west
        ((1.5, 0.0, 2.5), (-0.49, -0.32, 0.81)),  # a wall that leans over it pushes it down
        ((-0.6, 0.0, 0.6), (-0.97, -0.26, 0.0)),  # friction at an upright one does so, too
    ],
)
def test_the_normal_is_the_forces_until_the_velocity_after_the_contact_is_known(after_ned_m_s, direction_ned):
    record = flight_with().collisions[0]
    half = math.sqrt(0.5)
    record.estimator.note_contact(True, HIT_US, Normal((-half, -half, 0.0), 0.35), 0.0)
    assert record.normal.direction_ned == (-half, -half, 0.0)
    record.estimator.after_ned_m_s, record.estimator.after_error_m_s = after_ned_m_s, 0.05
    assert record.normal.direction_ned == pytest.approx(direction_ned, abs=0.02)
    # And where the velocity before it is not known, nothing is changed by it
    record.estimator.contact = replace(record.contact, velocity_error_m_s=math.inf)
    assert record.normal.direction_ned == (-half, -half, 0.0)
    record.estimator.note_contact(True, HIT_US, Normal(), 0.0)
    assert record.normal.direction_ned == ZERO


def test_a_second_hit_of_a_vehicle_whose_velocity_is_not_known_turns_no_normal_by_what_follows_it():
    # Given a clipped hit, whose velocity is known to 0.7 m/s, and another one at once
    contact = Contact(AT, (2.0, 0.0, 0.0), SOUTH, 0.2)
    flight = flight_with(estimator=MotionEstimator(contact, HIT_US, contact.rebound(0.45), EstimateConfig()))
    first = flight.collisions[0]
    first.surfaces = [replace(first.surfaces[0], normal_ned=(-0.8, 0.6, 0.0))]
    impact = Impact(HIT_US + 100_000, HIT_US + 96_000, (-20.0, 0.0, 0.0))
    estimate = flight.reflex.monitor.estimator.begin(impact)
    record = flight.reflex.begin(estimate, FlightRoom(flight), 100_000)
    # Then what was hit before is where it is known to be
    assert first.surfaces[0] in record.surfaces
    # and its velocity is the belief's, as uncertain as that
    assert record.contact.velocity_ned_m_s == pytest.approx((-0.9, 0.0, 0.0))
    assert record.contact.velocity_error_m_s == pytest.approx(SAME_M_S + 0.3 * 2.0)


def test_the_way_off_follows_the_normal_as_it_becomes_known():
    # Given a force whose first sample shows a wall in the north, and the next ones one in the north-west
    flight = flight_with()
    recover, estimator = recover_in(flight), flight.collisions[0].estimator
    hears(flight, recover, 100_000, 2.95, 0.0)
    straight_m = flight.collisions[0].setpoint_ned_m[1]
    estimator.note_contact(True, HIT_US, Normal((-0.8, 0.6, 0.0), 0.1), 0.0)
    hears(flight, recover, 120_000, 2.95, 0.0)
    assert straight_m == pytest.approx(0.0, abs=0.02) and flight.collisions[0].setpoint_ned_m[1] > 0.1


def test_between_surfaces_that_it_cannot_be_clear_of_it_is_handed_over_in_the_middle():
    flight = flight_with()
    recover = recover_in(flight, Surface((2.96, 0.0, -2.0), (1.0, 0.0, 0.0), 0.35))
    for since_us in range(100_000, 400_000, 20_000):
        _, sent = hears(flight, recover, since_us, 2.995, 0.0)
    assert isinstance(sent, PositionSetpoint) and sent.position_ned_m[0] == pytest.approx(2.98)


def test_it_is_not_handed_over_on_the_obstacle():
    flight = flight_with(companion={"settled": {"distance_m": 0.5}})
    recover = recover_in(flight)
    for since_us in range(100_000, 1_600_000, 20_000):
        target, sent = hears(flight, recover, since_us, 2.95, 0.0)
    # Then it is flown off
    assert isinstance(sent, AttitudeSetpoint)
    w, _, y, _ = sent.attitude_wxyz
    assert 2.0 * w * y > 0.05, "nose up: it leans south"
    # PX4 flies it on until it misses the next one, and loops of 12 rad/s take two time constants to turn the thrust
    assert target.lean.held_s == pytest.approx(0.3 + NOTICED_S + 2.0 / 12.0, abs=0.03)


@pytest.mark.parametrize(
    ("loss_s", "learnt_s", "word"),
    [
        (1.0, 2.0, "for 1 s"),
        (None, 2.0, "unknown time"),
        (math.inf, 2.0, "takes no thrust"),
        (0.3, 0.3, "not known yet"),
    ],
)
def test_where_an_attitude_is_not_safe_the_plain_place_of_law_paper_is_sent(loss_s, learnt_s, word):
    flight = flight_with(loss_s, learnt_s)
    assert word in flight.reflex.why_by_position
    _, sent = hears(flight, recover_in(flight), 100_000, 2.9, -0.5)
    assert isinstance(sent, PositionSetpoint)
    assert sent.velocity_ned_m_s is None and sent.acceleration_ned_m_s2 is None


def test_a_surface_goes_along_while_it_pushes():
    # Given a screen that carries a vehicle south
    flight = flight_with()
    recover = recover_in(flight)
    for since_us in range(100_000, 600_000, 20_000):
        flight.collisions[0].estimator.external_m_s2 = (-3.0, 0.0, 0.0)
        hears(flight, recover, since_us, 3.0 - 0.8e-6 * since_us, -0.8)
    # Then its goal stays ahead of it
    assert flight.collisions[0].setpoint_ned_m[0] < 3.0 - 0.8 * 0.58 - 0.3


def test_what_slides_round_a_pole_leads_off_the_side_that_pushes_and_does_not_lean_against_it():
    # Given a vehicle that hit the pole's south side, and is pushed to the east by what it lies on
    flight = flight_with()
    recover, record = recover_in(flight), flight.collisions[0]
    record.estimator.external_m_s2 = (0.0, 2.5, 0.0)
    hears(flight, recover, 100_000, 3.0, 0.0)
    # Then the way leads to the east, and the push is no wind
    assert record.setpoint_ned_m[1] == pytest.approx(0.35, abs=0.02)
    acceleration, lean = flight.reflex.lean()
    assert acceleration[1] > 2.0 and lean.belief.external_m_s2 == ZERO


@pytest.mark.parametrize(("keeps_trim", "wind_m_s2"), [(False, 1.0), (True, 0.0)])
def test_the_wind_is_sent_to_a_position_control_that_begins_without_it(keeps_trim, wind_m_s2):
    flight = flight_with()
    flight.reflex.keeps_trim, estimator = keeps_trim, flight.collisions[0].estimator
    estimator.has_converged, estimator.wind_m_s2 = True, (0.0, 1.0, 0.0)
    assert flight.reflex.left_wrong(HIT_US + 1_000_000).pushed_m_s2 == (0.0, wind_m_s2, 0.0)


def measured_apart(later_us: int = 13_000_000) -> MotionEstimator:
    """Of a hit whose error a receiver shows, so much later."""
    contact, now_us = Contact(AT, (2.0, 0.0, 0.0), SOUTH, 0.2), HIT_US + later_us
    estimator = MotionEstimator(contact, HIT_US, contact.rebound(0.45), EstimateConfig())
    estimator.imu(Strapdown(time_boot_us=now_us))
    for taken_us in range(now_us, now_us + 100):
        estimator.measure(Doppler(taken_boot_us=taken_us))
    estimator.has_converged, estimator.position_error_m = True, (30.0, 0.0, 0.0)
    return estimator


def test_it_is_not_handed_over_to_a_velocity_that_is_far_off():
    flight = flight_with()
    recover, estimator = recover_in(flight), flight.collisions[0].estimator
    # Given a vehicle at rest that takes itself for 2 m/s fast, and then for 0.5
    for from_us, wrong_m_s, kind in ((100_000, 2.0, AttitudeSetpoint), (600_000, 0.5, PositionSetpoint)):
        estimator.velocity_error_m_s = (wrong_m_s, 0.0, 0.0)
        for since_us in range(from_us, from_us + 500_000, 20_000):
            _, sent = hears(flight, recover, since_us, 2.4, wrong_m_s)
        assert isinstance(sent, kind)


def test_it_is_not_handed_over_while_what_is_wrong_of_its_velocity_may_swing():
    # Given a vehicle at rest just after a hit that soon takes itself for 1 m/s fast
    estimator = measured_apart(200_000)
    estimator.motion = MotionState((2.4, *AT[1:]), ZERO)
    flight = flight_with(estimator=estimator)
    recover = recover_in(flight)
    for since_us in range(220_000, 500_000, 20_000):
        estimator.imu(Strapdown(time_boot_us=HIT_US + since_us))
        _, sent = hears(flight, recover, since_us, 2.4, 1.0 if since_us > 280_000 else 0.0)
    assert isinstance(sent, AttitudeSetpoint)


def test_what_a_receiver_shows_to_be_wrong_is_followed_after_the_recovery():
    flight = flight_with(estimator=measured_apart())
    record = flight.collisions[0]
    record.is_over = True
    wrong = LocalPosition(HIT_US + 13_000_000, (record.estimator.motion.position_ned_m[0] + 20.0, 0.0, -2.0), ZERO)
    record.source.update(ImuSample(wrong.time_boot_us, ZERO, ZERO))
    record.source.update(wrong)
    assert record.estimator.position_error_m[0] == pytest.approx(20.0)


def test_a_position_that_is_heard_again_moves_no_surface():
    # Given a recovery in which the position of just after the hit comes by another way again and again
    goals = []
    for is_repeated in (False, True):
        f = flying_in("recovering")
        hit = f.companion.core.flight.collisions[-1]
        stamp_ms, (north, _, down) = hit.estimator.hit_boot_us // 1000 + 20, hit.contact.position_ned_m
        while f.state == "recovering":
            f.run_for(0.1)
            if is_repeated:
                f.vehicle.send(mav.MAVLink_local_position_ned_message(stamp_ms, north, 0.0, down, -0.5, 0.0, 0.0))
        goals.append(hit.setpoint_ned_m)
    # Then the goal is as without it
    assert goals[0] == pytest.approx(goals[1], abs=0.01)


@pytest.mark.parametrize("is_apart", [False, True])
def test_what_is_left_wrong_of_a_hit_fades_but_while_a_receiver_shows_it(is_apart):
    flight = flight_with(estimator=measured_apart() if is_apart else None)
    flight.collisions[0].estimator.has_converged = True
    wrong = flight.reflex.left_wrong(HIT_US + 13_000_000)
    assert wrong.share == 1.0 if is_apart else wrong is None
    # Nor does anything of it hold of a vehicle that has restarted, whose clock begins anew
    assert flight.reflex.left_wrong(1).share == 1.0 and len(all_known(flight).patches) == 1
    flight.reflex.restart(0)
    assert flight.reflex.newest is None and flight.reflex.in_one_recovery() == [] and all_known(flight).patches == ()
    # Nor when a hit after it is taken back
    flight.collisions.append(flight_with().collisions[0])
    flight.reflex.take_back()
    assert flight.reflex.newest is None


@pytest.mark.parametrize("is_over", [False, True])
def test_a_vehicle_that_takes_itself_for_outside_the_fence_is_where_the_belief_has_it(is_over):
    # Given an estimate that a hit has left wrong by 30 m
    flight = flight_with(estimator=measured_apart())
    flight.armed_at_us, flight.collisions[0].is_over = 0, is_over
    positions = [LocalPosition(HIT_US + since_us, (33.0, 0.0, -2.0), ZERO) for since_us in (12_980_000, 13_000_000)]
    for sample in positions:
        flight.vehicle.history.add(sample)
    # Then neither the flight ends nor is the setpoint held back
    assert early_end(flight, State.RECOVERING, Inputs(positions=positions), 0) is None
    asked = Target(AT, 0.0)
    assert Limiter().passed(flight, asked, has_floor=True, moved=True, now_us=0) == asked


@pytest.mark.parametrize("wrong_m_s", [40.0, math.nan])
def test_what_is_added_for_the_vehicles_errors_stays_inside_fence_and_limits_or_is_a_fault(wrong_m_s):
    # Given an estimate whose known errors no vehicle has
    flight = flight_with()
    estimator = flight.collisions[0].estimator
    estimator.has_converged, estimator.velocity_error_m_s = True, (0.0, wrong_m_s, 0.0)
    estimator.position_error_m = estimator.level_m_s2 = (wrong_m_s, wrong_m_s, 0.0)
    asked, hit_us = Target((1.0, 2.0, -3.0), 0.5), flight.collisions[0].estimator.hit_boot_us

    def sent() -> Target:
        return Limiter().in_vehicles_view(flight, asked, has_floor=True, time_boot_us=hit_us + 1_000_000)

    # Then what would leave is no further than the fence, and no faster than the limits, or nothing
    if math.isnan(wrong_m_s):
        with pytest.raises(SetpointError):
            sent()
    else:
        limits, place = flight.mission.limits, sent().position_ned_m
        assert flight.mission.fence.nearest_inside(*place[:2]) == pytest.approx(place[:2], abs=1e-4)
        assert math.hypot(*(sent().velocity_ned_m_s or ZERO)) <= limits.max_speed_m_s + 1e-9
        assert math.hypot(*(sent().acceleration_ned_m_s2 or ZERO)) <= 9.81 * math.tan(math.radians(limits.max_tilt_deg))


# Whatever the mission's own policies and laws are
HASTY = MISSION | {
    "on_collision": {"hold_s": 0.1},
    "fence": {"radius_m": 3, "max_height_m": 2.5},
    "recovery": {"law": "paper"},
}


@pytest.mark.parametrize("who", [Companion(Mission.model_validate(HASTY)), Guard(GuardConfig())])
def test_a_rehearsed_hit_is_recovered_from_by_attitude_by_another_one(who):
    # Given one that has heard nothing. When it rehearses, then the other one answers the hit sample by sample
    said = list(who._rehearsed())
    assert sum(isinstance(message, AttitudeSetpoint) for message in said) >= 10
    # And every message of it can be packed, and it has done nothing itself
    assert all(Encoder().packets(message) for message in said)
    who.rehearse()
    assert not (who.core.reflex.hits or who.core.flight.events or who.core.flight.outbox)
