"""Random missions: drawn from their seed alone; the judge finds each cause of a failure, and none in a good flight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.cases.missions import MissionCase, airframe_of, random_mission
from bench.rows.contacts import Role, contacts_of
from bench.rows.judge import failures
from bench.rows.recovered import recoveries
from companion.mission.config import CompanionConfig
from tests.bench.random_missions import made_up
from tests.bench.random_missions.made_up import DONE_S, collision, event, events_with_hit, flight, hit, path, room


def test_a_mission_with_a_drawn_vehicle_says_of_it_what_its_owner_can_measure():
    case = MissionCase(9, "foldable", is_drawn=True)
    vehicle, settings = airframe_of(case), random_mission(case).data["companion"]
    config = CompanionConfig.model_validate(settings).estimate
    assert config.guards.centre_m == pytest.approx(vehicle.geometry.motor_radius_m)
    assert config.guards.radius_m == pytest.approx(vehicle.geometry.guard_radius_m)
    assert config.accelerometer_range_m_s2 == vehicle.imu.accelerometer_range_m_s2
    # The room and the mission are those of the named vehicle
    named = random_mission(MissionCase(9, "foldable")).data
    assert {**named, "companion": 0} == {**random_mission(case).data, "companion": 0}


LANDS_THERE = [event(12.0, "landing"), event(DONE_S, "done")]
LANDS_LATER = [event(13.6, "landing"), event(DONE_S, "done")]
LAND, DETOUR = {"then": "land"}, {"then": "detour"}


def way(*points):
    """Up, by these places, which are (seconds, north, east, height), and 2 s on the ground of the last."""
    return path((0, 0, 0, 0), (5, 0, 0, 0), (8, 0, 0, 2), *points, (17, *points[-1][1:]))


# At the wall at 10 s, back half a metre, down there.
BOUNCED = way((10, 2, 0, 2), (11, 1.5, 0, 2), (13, 1.5, 0, 2), (16.5, 1.5, 0, 0))


def causes(judged):
    return [cause for cause, _ in failures(judged)]


def bounced(*after, policy=LAND, **settings):
    """Hit the wall, seen, recovered; then `after`, which is right for `land` by default."""
    settings = {"hits": [hit()], "collisions": [collision()], "series": BOUNCED, **settings}
    return flight(events_with_hit(*(after or LANDS_THERE)), on_collision=policy, **settings)


def test_a_vehicle_that_leans_by_more_than_a_right_angle_has_tumbled():
    series = made_up.plain_path()
    half = math.radians(100.0) / 2
    series["attitude_wxyz"][500] = [math.cos(half), math.sin(half), 0.0, 0.0]
    assert causes(flight(series=series)) == ["tumbled"]


SMALL_FENCE = {"fence": {"radius_m": 4.0}}


@pytest.mark.parametrize(
    ("points", "settings", "cause"),
    [
        pytest.param([(12, 4, 0, 2), (13, 4, 0, 0)], {}, "fell", id="2 m/s at the ground, though told to land"),
        pytest.param([(12, 4, 0, 2), (14, 4, 0, 0)], {}, None, id="1 m/s"),
        pytest.param([(10, 2, 0, 0), (12, 4, 0, 2), (15.5, 4, 0, 0)], {}, "touched the ground", id="on its way"),
        pytest.param([(12, 4, 0, 2), (15.5, 4, 0, 0)], SMALL_FENCE, None, id="in the fence"),
        pytest.param([(10, 5.2, 0, 2), (12, 4, 0, 2), (15.5, 4, 0, 0)], SMALL_FENCE, "left the fence", id="outside"),
        pytest.param([(12, 3.2, 0, 2), (15.5, 3.2, 0, 0)], {}, "not where the mission says", id="short of its goal"),
        pytest.param([(12, 4, 0, 2), (15.5, 4, 1.5, 0)], {}, "not where the mission says", id="lands elsewhere"),
    ],
)
def test_where_a_vehicle_truly_was_shows_what_it_did_not_do(points, settings, cause):
    assert causes(flight(series=way(*points), **settings)) == ([cause] if cause else [])


@pytest.mark.parametrize(("north_m", "found"), [(0.3, []), (1.3, ["not where the mission says"])])
def test_home_is_where_it_started(north_m, found):
    items = [{"takeoff": {"height_m": 2}}, {"go_to": {"position_ned_m": [4, 0, -2]}}, {"return": {}}]
    home = [event(5, "armed"), event(8, "item", step=1), event(10, "item", step=2), event(10, "return")]
    home += [event(14, "landing"), event(DONE_S, "done")]
    series = way((10, 4, 0, 2), (14, north_m, 0, 2), (16.9, north_m, 0, 0))
    assert causes(flight(home, series, items=items)) == found


def test_a_guard_of_a_leaning_vehicle_touches_the_ground_before_its_feet():
    dips = way((10, 2, 0, 0.1), (12, 4, 0, 2), (15.5, 4, 0, 0))
    assert causes(flight(series=dips)) == []
    at_the_lowest = int(np.argmin(np.abs(dips["time_boot_us"] - 10e6)))
    half = math.radians(75.0) / 2
    dips["attitude_wxyz"][at_the_lowest] = [math.cos(half), math.sin(half), 0.0, 0.0]
    assert causes(flight(series=dips)) == ["touched the ground"]
    # Who answers that has answered a hit
    assert "answered a hit that was none" not in causes(flight(series=dips, collisions=[collision()]))


def test_a_hit_that_nobody_noticed_is_a_failure_unless_it_was_a_slow_touch():
    assert causes(flight(hits=[hit(speed_m_s=0.6)])) == ["hit not noticed"]
    assert causes(flight(hits=[hit(speed_m_s=0.4)])) == []


def test_a_contact_that_fell_between_the_samples_explains_a_detection_shortly_after_it():
    assert causes(bounced(collisions=[collision(at_s=10.12)])) == []
    assert causes(bounced(collisions=[collision(at_s=10.3)])) == ["hit not noticed", "answered a hit that was none"]


def test_an_abort_is_a_failure_unless_the_policy_asked_for_it():
    aborts = [event(12, "aborted")]
    asked = {"then": "hold", "max_hits": 1, "after_max_hits": "abort"}
    assert causes(bounced(*aborts, policy=asked, outcome="aborted")) == []
    assert causes(bounced(*aborts, outcome="aborted")) == ["not as the mission says"]
    assert causes(bounced(*aborts, policy=asked, outcome="failed")) == ["not as the mission says"]


def test_a_vehicle_that_drifts_while_it_holds_is_a_failure():
    hold = [event(12, "hold"), event(14, "item", step=2), event(14, "landing"), event(DONE_S, "done")]
    policy = {"then": "hold", "hold_s": 2}
    assert causes(bounced(*hold, policy=policy, series=_held_at(1.5))) == []
    assert causes(bounced(*hold, policy=policy, series=_held_at(0.8))) == ["not where the mission says"]


def _held_at(north_m):
    """At 1.5 m when the hold begins, there when it ends."""
    return way((10, 2, 0, 2), (12, 1.5, 0, 2), (14, north_m, 0, 2), (16.5, north_m, 0, 0))


def test_the_same_place_hit_twice_is_a_failure_unless_it_was_tried_again_on_purpose():
    touched = (2.2, 0.1, -2.0)
    twice = [replace(hit(), contact_point_ned_m=touched), replace(hit(at_s=12.6), contact_point_ned_m=touched)]
    seen = [collision(), collision(at_s=12.604)]
    again = [event(12, "item", step=2), event(12.61, "detection"), event(13.6, "recovered"), *LANDS_LATER]
    items = [{"takeoff": {"height_m": 2}}, *[{"go_to": {"position_ned_m": [4, 0, -2]}}] * 2, {"land": {}}]
    policy = {"then": "continue", "max_hits": 2}
    judged = bounced(*again, policy=policy, items=items, hits=twice, collisions=seen)
    assert causes(judged) == ["flew into a known surface"]
    # half a metre beside is not known
    beside = [twice[0], replace(twice[1], contact_point_ned_m=(2.2, 0.6, -2.0))]
    assert causes(bounced(*again, policy=policy, items=items, hits=beside, collisions=seen)) == []
    # nor is a place that a vehicle that has lost its position takes for another
    drifted = [twice[0], replace(twice[1], frame_offset_ned_m=(0.0, 0.6, 0.0))]
    assert causes(bounced(*again, policy=policy, items=items, hits=drifted, collisions=seen)) == []
    retried = [event(12, "item", step=1), *again[1:]]
    retry = {"then": "retry", "max_hits": 2}
    assert causes(bounced(*retried, policy=retry, hits=twice, collisions=seen)) == []


def test_a_goal_called_out_of_reach_is_one_behind_something():
    told = [event(12, "item", step=1), event(12, "unreachable", item="2", then="land"), *LANDS_THERE]
    judged = bounced(*told, policy=DETOUR)
    assert causes(judged) == []
    # with the wall 2 m beside the straight way, which is the line east = 0
    beside = room((2.2, 2.0, -2.0), (0.0, -1.0, 0.0))
    assert causes(replace(judged, scene=beside)) == ["gave up a goal in the open"]


def test_contacts_in_a_recovery_are_the_same_surface_again_or_another():
    again, other = hit(at_s=10.5), hit(at_s=11.0, obstacle="pole", normal=(1.0, 0.0, 0.0))
    landing = hit(at_s=15.0, obstacle="step", normal=(0.0, 0.0, -1.0))
    face = hit(at_s=10.8, normal=(0.0, 1.0, 0.0))
    judged = bounced(hits=[hit(), again, face, other, landing])
    roles = [Role.HIT, Role.AGAIN, Role.NEXT, Role.NEXT, Role.LANDING]
    assert [contact.role for contact in contacts_of(judged)] == roles
    (figures,) = recoveries(judged, contacts_of(judged))
    assert (figures["again"], figures["others"]) == (1, 2)


def test_a_guard_that_swings_in_while_the_vehicle_leaves_is_counted_apart_and_ends_no_recovery():
    # Given a vehicle that rebounds, in truth runs 0.2 m past its setpoint and sinks by 0.1 m, whose other guard brushes
    # the wall on the way
    series = path((0, 0, 0, 0), (10, 2, 0, 2), (10.5, 1.3, 0, 1.9), (11, 1.5, 0, 2), (17, 1.5, 0, 2))
    (figures,) = recoveries(*_touched_again(series))
    assert (figures["again"], figures["returned"]) == (1, 0)
    assert figures["past_m"] == pytest.approx(0.2, abs=0.02)
    assert figures["lost_m"] == pytest.approx(0.1, abs=0.01)
    assert figures["settled_s"] == pytest.approx(1.004)
    assert figures["closing_m_s"] == pytest.approx(2.0)
    # and one whose centre comes back for it
    back = path((0, 0, 0, 0), (10, 2, 0, 2), (10.2, 1.9, 0, 2), (10.3, 1.96, 0, 2), (11, 1.5, 0, 2), (17, 1.5, 0, 2))
    (figures,) = recoveries(*_touched_again(back, at_s=10.3))
    assert (figures["again"], figures["returned"]) == (1, 1)


def test_a_bounce_before_anybody_told_of_the_hit_belongs_to_it():
    judged = flight(hits=[hit(speed_m_s=0.6), hit(at_s=10.1, speed_m_s=0.6), hit(at_s=10.6, speed_m_s=0.6)])
    assert [contact.role for contact in contacts_of(judged)] == [Role.HIT, Role.AGAIN, Role.HIT]


def _touched_again(series, at_s=10.08):
    judged = bounced(series=series, hits=[hit(), hit(at_s=at_s, place=(1.96, 0.0, -2.08))])
    return judged, contacts_of(judged)


def test_a_recovery_goes_to_the_setpoint_that_was_told_last():
    # Given a contact that went on from one wall of a corner to the other, of which the companion told twice
    told = [collision(setpoint=(1.8, 0.0, -2.08), settled_s=None), collision(at_s=10.02)]
    series = path((0, 0, 0, 0), (10, 2, 0, 2), (11, 1.5, 0, 2), (17, 1.5, 0, 2))
    judged = flight(events_with_hit(*LANDS_THERE), series, [hit()], told)
    (figures,) = recoveries(judged, contacts_of(judged))
    assert figures["past_m"] == pytest.approx(0.0, abs=0.01), "0.3 m past the one that was given up"
    assert figures["settled_s"] == pytest.approx(1.02)
