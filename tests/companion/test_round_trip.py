"""The round trip to the vehicle by TIMESYNC: asked, matched with what was asked, judged before a flight and in it."""

import itertools

import pytest

from bench.fly.virtual_time import EPOCH_US
from companion.link.round_trip import RoundTrip
from companion.messages import TimeSyncAnswer, TimeSyncAsk
from companion.report import RoundTripReport
from rebound_cli.live.console import state_fields
from tests.companion.fake_vehicle import FakeVehicle, flight

TICK_US = 4_000


def asked_over(trip: RoundTrip, seconds: float, start_us: int = EPOCH_US) -> list[TimeSyncAsk]:
    times = range(start_us, start_us + round(seconds * 1e6), TICK_US)
    return [question for now_us in times if (question := trip.ask(now_us)) is not None]


def answered(trip: RoundTrip, *trips_us: int, start_us: int = EPOCH_US) -> None:
    """Questions two seconds apart, each answered after so long."""
    for number, trip_us in enumerate(trips_us):
        now_us = start_us + 2_000_000 * number
        question = trip.ask(now_us)
        assert question is not None
        trip.update(TimeSyncAnswer(question.companion_time_ns, 7), now_us + trip_us)


def test_it_asks_ten_times_a_second_until_a_first_answer_and_then_once():
    trip = RoundTrip()
    first = asked_over(trip, 2.0)
    assert [b.companion_time_ns - a.companion_time_ns for a, b in itertools.pairwise(first)] == [100_000_000] * 19
    trip.update(TimeSyncAnswer(first[-1].companion_time_ns, 7), EPOCH_US + 2_000_000)
    assert len(asked_over(trip, 5.0, EPOCH_US + 2_000_000)) == 5


def test_an_answer_to_nobodys_question_and_a_second_answer_are_counted_and_no_more():
    # Given a question
    trip = RoundTrip()
    question = trip.ask(EPOCH_US)
    assert question is not None
    # When another's answer comes, then its own twice
    trip.update(TimeSyncAnswer(question.companion_time_ns - 5_000_000_000, 7), EPOCH_US + 1_000)
    assert trip.present_us is None
    trip.update(TimeSyncAnswer(question.companion_time_ns, 7), EPOCH_US + 3_000)
    trip.update(TimeSyncAnswer(question.companion_time_ns, 7), EPOCH_US + 900_000)
    # Then one counts
    assert (trip.present_us, trip.report()) == (3_000, RoundTripReport(3_000, 3_000, 2))


def test_the_alarm_is_given_once_while_it_lasts_and_again_after_five_short_ones():
    trip, told = RoundTrip(), []
    trips_us = [2_000] * 5 + [400_000] * 6 + [2_000, 400_000] * 4 + [2_000] * 5 + [400_000] * 5
    for number, trip_us in enumerate(trips_us):
        answered(trip, trip_us, start_us=EPOCH_US + 2_000_000 * number)
        if trip.alarm() is not None:
            told.append(number)
    assert told == [7, 26]


# --- in a flight


@pytest.mark.parametrize(
    ("vehicle", "in_the_plan", "in_the_line", "report"),
    [
        (FakeVehicle(round_trip_us=20_000), "round trip 20.0 ms", "20 ms", RoundTripReport(20_000, 20_000, 0)),
        # One that answers no TIMESYNC may be flown
        (FakeVehicle(does_answer_time=False), "round trip unknown: TIMESYNC is not answered", None, RoundTripReport()),
    ],
    ids=["answers", "does not"],
)
def test_a_flight_tells_its_round_trip_in_the_plan_the_live_line_and_the_report(
    vehicle, in_the_plan, in_the_line, report
):
    f = flight(vehicle, confirmed=False)
    f.run_to("ready")
    assert in_the_plan in f.companion.plan_text()
    f.companion.confirm_plan()
    f.run_to("mission")
    assert dict(state_fields(f.companion.status(), 1.0)).get("round trip") == in_the_line
    f.run_to_end()
    assert (f.report.outcome, f.report.round_trip) == ("completed", report)
    assert "round_trip" not in f.kinds()


@pytest.mark.parametrize("grows", [False, True])
def test_a_vehicle_that_is_too_far_away_is_not_armed_though_its_plan_was_agreed_to(grows):
    # Given 200 ms each way, from the beginning or while the plan is read
    f = flight(FakeVehicle(round_trip_us=0 if grows else 400_000), confirmed=not grows)
    if grows:
        f.run_to("ready")
        f.vehicle.round_trip_us = 400_000
        f.run_for(6.0)
        f.companion.confirm_plan()
    # When it is to be flown, then it is refused with the figure, before anything was asked of it
    assert f.run_to_end().outcome == "failed"
    assert f.report.reason.startswith("the round trip to the vehicle takes 400 ms and at most 100 ms are allowed")
    assert set(f.vehicle.counts) <= {511, 512} and f.vehicle.setpoints == []


def test_a_round_trip_that_grows_in_flight_is_told_once_and_the_flight_goes_on():
    f = flight()
    f.run_to("mission")
    f.vehicle.round_trip_us = 400_000
    report = f.run_to_end()
    assert report.outcome == "completed"
    assert f.kinds().count("round_trip") == 1
    assert f.event("round_trip").data["round_trip_us"] == 400_000
    texts = [message.text for _, message in f.messages("STATUSTEXT")]
    assert texts.count("Round trip 400 ms: hits are answered late") == 1
    assert report.round_trip.worst_us == 400_000
