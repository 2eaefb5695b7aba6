"""A vehicle at the end of a slow link: 200 ms each way are a refusal before take-off and an alarm in flight."""

import pytest

from companion.guard.states import State
from rebound_cli.results.summary import FlightFacts, Flown, build_summary
from tests.flying import EPOCH_US, Flight
from tests.guard.flying import GuardedFlight as Air
from tests.simulated import simulated

pytestmark = pytest.mark.flight

FAR = {"kind": "wire", "delay_s": 0.2}


def flown(*faults) -> Flight:
    """Over, after square.yaml."""
    flight = simulated("square", f"sim.faults={list(faults)}")
    flight.run_to_end(200.0)
    return flight


def test_a_healthy_flights_round_trip_is_an_interval_of_the_simulation():
    flight = flown()
    assert flight.report.outcome == "completed" and flight.told("round_trip") == []
    assert flight.report.round_trip.median_us == flight.report.round_trip.worst_us == 4_000
    facts = FlightFacts("square", "foldable", 1, 0.5)
    summary = build_summary(Flown(flight.report, 1.0, None), facts)
    assert summary["round_trip_ms"] == {"median": 4.0, "worst": 4.0, "ignored": 0}


def test_200_ms_each_way_are_refused_before_take_off():
    flight = flown({**FAR, "at_s": 0})
    assert flight.report.outcome == "failed" and flight.report.armed_at_us is None
    words = "the round trip to the vehicle takes 404 ms and at most 100 ms are allowed"
    assert flight.report.reason.startswith(words)


def test_200_ms_each_way_in_flight_are_told_once():
    flight = flown({**FAR, "at_s": 20})
    assert flight.kinds().count("round_trip") == 1
    # three answers of five, which are asked for once a second, and the one on its way
    assert 22.0 < (flight.event("round_trip").time_us - EPOCH_US) / 1e6 < 25.0
    assert flight.report.round_trip.worst_us == 404_000


# --- the guard


def test_a_guard_does_not_begin_at_the_end_of_a_slow_link():
    air = Air(faults=[{**FAR, "at_s": 0}])
    air.run_until(lambda: air.guard.finished, 30.0)
    assert air.guard.outcome.startswith("the round trip to the vehicle takes 404 ms and at most 100 ms are allowed")


def test_a_guard_tells_of_a_link_that_became_slow_and_watches_on():
    air = Air(faults=[{**FAR, "at_s": 15}])
    air.take_off()
    assert air.time_s < 15.0 and air.told("round_trip") == []
    air.run_until(lambda: air.told("round_trip") != [], 25.0)
    air.run_for(3.0)
    assert air.state is State.WATCHING
    assert air.told("round_trip") == ["round trip 404 ms: hits are answered late"]
    assert air.guard.round_trip().summary()["worst"] == pytest.approx(404.0)


def test_a_guard_on_the_ground_does_not_go_in_while_the_link_is_slow():
    # Given a guard that stands by, and a link that became slow
    air = Air(faults=[{**FAR, "between_s": [8, 26]}])
    air.run_to(State.STANDING_BY, 8.0)
    air.run_until(lambda: air.time_s > 14.0, 20.0)
    # When the vehicle takes off
    for action in (lambda: air.command(400, 1), lambda: air.command(22)):
        action()
        air.run_for(3.0)
    # Then the guard says why it stands by, and watches when the link is quick again
    air.run_for(5.0)
    assert air.state is State.STANDING_BY
    assert air.told("standing_by")[-1] == "standing by: the round trip to the vehicle takes too long"
    air.run_to(State.WATCHING, 40.0)
    assert air.time_s > 26.0
