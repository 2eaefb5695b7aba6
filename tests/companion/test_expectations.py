"""Assertions in a mission: met or not, the flight goes on; one not met makes it a failed one."""

from tests.companion.fake_vehicle import INTO_WALL, LANDING, TAKEOFF, at_wall, flight

# Steady when it meets the wall: the accelerometer of a vehicle that stays level does not show how it speeds up.
STEADY = {"flight": {"speeding_up_m_s2": 2.0}}


# (expectation, whether it is met, a piece of what was found), for a flight into a wall at 2 m/s
BEFORE_THE_HIT = [
    ({"collision": {"within_s": 5}}, True, "2.0"),
    ({"collision": {"within_s": 1}}, False, "no hit"),
    ({"collision": {"within_s": 5, "min_speed_m_s": 2.5}}, False, "hit at 2.0"),
    ({"collision": {"within_s": 5, "max_speed_m_s": 2.5}}, True, "2.0"),
    ({"no_collision": None}, False, "hit at"),
    ({"no_collision": {"for_s": 0.5}}, True, "none"),
]
AFTER_IT = [
    ({"no_collision": {}}, True, "none until the end"),
    ({"collision": {"within_s": 100}}, False, "none until the end"),
    ({"collisions": {"exactly": 1}}, True, "1"),
    ({"collisions": {"at_least": 2}}, False, "1"),
    ({"collisions": {"at_most": 1}}, True, "1"),
    ({"recovered": None}, True, "settled after"),
    ({"recovered": {"within_s": 0.1}}, False, "settled after"),
    ({"recovered": {"max_overshoot_m": 0.5}}, True, "too far"),
    ({"position": {"ned_m": [1.95, 0, -1.5], "within_m": 0.3}}, True, ""),
    ({"position": {"ned_m": [5, 0, -1.5], "within_m": 0.3}}, False, ""),
    ({"height": {"min_m": 1.3, "max_m": 1.7}}, True, "1.5"),
    ({"height": {"max_m": 1.0}}, False, "1.5"),
    ({"speed": {"max_m_s": 0.2}}, True, "m/s"),
    ({"flight_time": {"at_most_s": 5}}, False, " s"),
    ({"flight_time": {"at_most_s": 60}}, True, " s"),
]


def test_each_expectation_is_met_or_not_and_the_flight_goes_on():
    before, after = ([{"expect": wish} for wish, _, _ in wishes] for wishes in (BEFORE_THE_HIT, AFTER_IT))
    f = at_wall(*before, INTO_WALL, *after, companion=STEADY)
    report = f.run_to_end()
    for result, (wish, met, detail) in zip(report.expectations, [*BEFORE_THE_HIT, *AFTER_IT], strict=True):
        assert result.met is met, (wish, result)
        assert detail in result.detail, (wish, result)
    assert report.outcome == "failed"
    assert report.reason.startswith("expectation of item 3 not met: a hit within 1 s (was: no hit), and ")
    assert f.vehicle.landed == 1 and not f.vehicle.armed, "it lands as it would have"


def test_what_was_expected_of_a_flight_that_ended_early_is_told_too():
    f = flight(items=[TAKEOFF, {"expect": {"no_collision": {}}}, {"hold": {"duration_s": 9}}, LANDING])
    f.run_to("mission")
    f.run_for(1.0)
    f.companion.stop("Ctrl-C")
    report = f.run_to_end()
    assert report.outcome == "aborted" and report.reason == "Ctrl-C"
    assert [result.met for result in report.expectations] == [True]
