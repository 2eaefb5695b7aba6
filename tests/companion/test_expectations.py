"""Assertions in a mission: met or not, the flight goes on; one not met makes it a failed one."""

from types import SimpleNamespace

import pytest

from companion.flight.context import Expectation
from companion.flight.expecting import review
from companion.mission.expectations import ExpectItem
from tests.companion.fake_vehicle import FakeVehicle, Flight, flight

TAKEOFF, LAND = {"takeoff": {"height_m": 1.5}}, {"land": {}}
INTO_WALL = {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}}


def flown(*items, wall_north_m=3.0) -> Flight:
    f = flight(FakeVehicle(wall_north_m=wall_north_m), items=[TAKEOFF, *items, LAND])
    f.run_to_end()
    return f


@pytest.mark.parametrize(
    ("before", "after", "met", "detail"),
    [
        ({"collision": {"within_s": 5}}, None, True, "2.0"),
        ({"collision": {"within_s": 1}}, None, False, "no hit"),
        ({"collision": {"within_s": 5, "min_speed_m_s": 2.5}}, None, False, "hit at 2.0"),
        ({"collision": {"within_s": 5, "max_speed_m_s": 2.5}}, None, True, "2.0"),
        ({"no_collision": None}, None, False, "hit at"),
        ({"no_collision": {"for_s": 0.5}}, None, True, "none"),
        (None, {"no_collision": {}}, True, "none until the end"),
        (None, {"collision": {"within_s": 100}}, False, "none until the end"),
        (None, {"collisions": {"exactly": 1}}, True, "1"),
        (None, {"collisions": {"at_least": 2}}, False, "1"),
        (None, {"collisions": {"at_most": 1}}, True, "1"),
        (None, {"recovered": None}, True, "settled after"),
        (None, {"recovered": {"within_s": 0.1}}, False, "settled after"),
        (None, {"recovered": {"max_overshoot_m": 0.5}}, True, "too far"),
        (None, {"position": {"ned_m": [2, 0, -1.5], "within_m": 0.3}}, True, ""),
        (None, {"position": {"ned_m": [5, 0, -1.5], "within_m": 0.3}}, False, ""),
        (None, {"height": {"min_m": 1.3, "max_m": 1.7}}, True, "1.5"),
        (None, {"height": {"max_m": 1.0}}, False, "1.5"),
        (None, {"speed": {"max_m_s": 0.2}}, True, "m/s"),
        (None, {"flight_time": {"at_most_s": 5}}, False, " s"),
        (None, {"flight_time": {"at_most_s": 60}}, True, " s"),
    ],
)
def test_an_expectation_is_met_or_makes_the_flight_a_failed_one(before, after, met, detail):
    f = flown(*([{"expect": before}] if before else []), INTO_WALL, *([{"expect": after}] if after else []))
    report = f.companion.report()
    (result,) = report.expectations
    assert result.met is met
    assert detail in result.detail
    assert report.outcome == ("completed" if met else "failed")
    assert f.vehicle.landed == 1 and not f.vehicle.armed, "it lands as it would have"
    if not met:
        assert report.reason.startswith(f"expectation of item {2 if before else 3} not met: ")


def test_what_was_expected_of_a_flight_that_ended_early_is_told_too():
    f = flight(items=[TAKEOFF, {"expect": {"no_collision": {}}}, {"hold": {"duration_s": 9}}, LAND])
    f.run_to("mission")
    f.run_for(1.0)
    f.companion.stop("Ctrl-C")
    f.run_to_end()
    report = f.companion.report()
    assert report.outcome == "aborted" and report.reason == "Ctrl-C"
    assert [result.met for result in report.expectations] == [True]


def test_the_first_of_several_failures_is_the_reason():
    f = flown({"expect": {"no_collision": {}}}, INTO_WALL, {"expect": {"collisions": {"exactly": 0}}})
    assert f.companion.report().reason.endswith(", and 1 more")


def test_a_hit_that_is_heard_of_late_came_late():
    """Hit and deadline in one step, as when packets come in batches: the hit's own time counts."""
    wish = Expectation("2", "a hit", ExpectItem(collision={"within_s": 5}), 0, 0)
    for hit_at_us, met in ((4_990_000, True), (5_010_000, False)):
        wish.met = None
        hit = SimpleNamespace(impact_speed_m_s=2.0, detected_at_us=hit_at_us)
        record = SimpleNamespace(report=lambda hit=hit: hit)
        review(SimpleNamespace(expectations=[wish], collisions=[record], tell=lambda *a, **b: None), 5_050_000)
        assert wish.met is met
