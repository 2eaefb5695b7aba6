"""The other end: who it is, how fast it talks and answers, what happens when it does not."""

import itertools

import pytest
from pymavlink.dialects.v20 import development as mav

from bench.fly.virtual_time import EPOCH_US, INTERVAL_US
from companion.autopilot.ardupilot.firmware import ARDUPILOT
from companion.autopilot.px4.firmware import PX4
from companion.link.round_trip import RoundTrip
from companion.link.vehicle import Vehicle
from companion.messages import CurrentMode, Heartbeat, TimeSync
from rebound_cli.live.console import state_fields
from tests.companion.fake_vehicle import LAND, LOITER, OFFBOARD, FakeVehicle, flight
from tests.companion.flight.test_companion_authority import heartbeat


def failed(vehicle: FakeVehicle):
    f = flight(vehicle)
    report = f.run_to_end(40.0)
    assert (report.outcome, f.state) == ("failed", "aborted")
    return f, report


@pytest.mark.parametrize(
    ("vehicle", "word"),
    [
        (FakeVehicle(silent=True), "no HEARTBEAT from an autopilot within 10 s"),
        (FakeVehicle(autopilot=3), "ArduPilot"),
        (FakeVehicle(vehicle_type=1), "not a multicopter (MAV_TYPE 1)"),
        (FakeVehicle(imu_every=8), "HIGHRES_IMU arrives at 31.8 Hz"),
        (FakeVehicle(no_imu=True), "HIGHRES_IMU arrives at 0.0 Hz"),
        (FakeVehicle(no_positions=True), "LOCAL_POSITION_NED"),
        (FakeVehicle(armed=True), "armed already"),
        (FakeVehicle(landed=2), "not on the ground"),
        (FakeVehicle(ack=lambda *_: []), "the vehicle answers nothing"),
    ],
)
def test_vehicles_that_cannot_be_flown_are_refused_with_the_reason(vehicle, word):
    _, report = failed(vehicle)
    assert word in report.reason
    assert [m for _, m in vehicle.commands if m.command in (176, 400)] == []


def test_a_vehicle_that_has_just_started_is_given_time_for_its_first_position():
    # Given one that has none yet when its streams have been measured
    f = flight(FakeVehicle(no_positions=True))
    f.run_for(4.0)
    assert f.state == "connect" and "link: not ready by now" in f.texts()[-1]
    # When it has one, then the flight begins, though nobody said that it waits
    f.vehicle.no_positions = False
    assert f.run_to_end().outcome == "completed"


WAITS = {"link": {"wait": True, "heartbeat_wait_s": 1.0}, "streams": {"window_s": 0.5}}


def test_a_flight_that_waits_outlasts_a_vehicle_that_is_missing_restarts_and_has_no_position_at_first():
    # Given nobody on the link for a minute
    f = flight(FakeVehicle(silent=True, no_positions=True), confirmed=False, companion=WAITS)
    f.run_for(60.0)
    assert f.texts() == ["link: no HEARTBEAT from an autopilot within 1 s: waiting for it"]
    # When a vehicle starts that has no position yet
    f.vehicle.silent = False
    f.run_for(10.0)
    assert f.state == "connect"
    told = [text for text in f.texts() if "not ready by now" in text]
    assert len(told) == 1 and "no position: LOCAL_POSITION_NED does not arrive" in told[0]
    # Then its plan is ready once it has one, and again after it was silent for a minute; nothing is armed meanwhile
    for spoiled in ("no_positions", "silent"):
        setattr(f.vehicle, spoiled, False)
        f.run_to("ready", 5.0)
        f.vehicle.silent = True
        f.run_for(60.0)
        assert not f.companion.finished
    assert [m for _, m in f.vehicle.commands if m.command in (176, 400)] == []
    f.vehicle.silent = False
    f.run_for(3.0)
    f.companion.confirm_plan()
    assert f.run_to_end().outcome == "completed"


def test_a_flight_that_waits_does_not_take_a_vehicle_back_after_a_silence_in_the_air():
    f = flight(companion=WAITS)
    f.run_to("mission")
    # When the link falls silent in flight, and is there again
    f.vehicle.silent = True
    f.run_for(6.0)
    assert f.companion.finished
    f.vehicle.silent = False
    before = len(f.vehicle.commands)
    f.run_for(5.0)
    # Then the flight has ended, as without --wait, and nothing is commanded any more
    assert f.report.outcome == "aborted"
    assert len(f.vehicle.commands) == before


def test_a_vehicle_armed_by_someone_else_while_the_plan_is_read_is_not_taken():
    f = flight(confirmed=False)
    f.run_to("ready")
    f.vehicle.armed = True
    f.run_for(1.1)
    f.companion.confirm_plan()
    f.run_to_end(0.1)
    assert "armed already" in f.report.reason
    assert f.report.outcome == "failed"


def test_of_two_vehicles_on_a_link_the_first_is_taken():
    f = flight()
    first, other = heartbeat(LOITER, False, 5), heartbeat(LAND, True, 6)
    f.companion.step(first + other, f.now_us)
    f.companion.step(other, f.now_us + 4000)
    assert f.companion.status().vehicle_mode == "AUTO.LOITER"
    assert not f.companion.status().armed


def test_the_streams_that_the_detector_uses_are_asked_for_and_the_vehicles_time_requests_answered():
    f = flight(confirmed=False)
    f.run_to("ready")
    asked = {int(m.param1): m.param2 for _, m in f.vehicle.commands if m.command == 511}
    always = {105: 4000, 32: 20_000, 31: 20_000, 245: 200_000, 436: 100_000, 24: 100_000, 26: 40_000}
    assert asked == always | {83: 33_333, 331: 33_333}
    assert len(f.vehicle.timesyncs) > 5
    answer = f.vehicle.timesyncs[-1]
    assert answer.tc1 // 1000 == pytest.approx(f.now_us, abs=200_000)
    assert answer.ts1 // 1000 == pytest.approx(f.vehicle.time_us, abs=200_000)


def test_refused_and_unanswered_stream_requests_do_not_stop_a_vehicle_that_streams_anyway():
    f = flight(FakeVehicle(ack=lambda command, count: [] if command == 512 else [4] if command == 511 else [0]))
    f.vehicle.obey = lambda command, count: command != 512
    report = f.run_to_end()
    assert (report.outcome, report.autopilot) == ("completed", "PX4"), "the version is optional"
    assert [e.text for e in f.events if e.kind == "command" and "FAILED" in e.text]


def test_lost_answers_and_lost_commands_are_repeated():
    f = flight(FakeVehicle(ack=lambda c, n: [] if n % 2 else [0], obey=lambda c, n: n % 2 == 0))
    assert f.run_to_end().outcome == "completed"
    confirmations = [m.confirmation for _, m in f.vehicle.commands if m.command == 400]
    assert confirmations == [0, 1]


@pytest.mark.parametrize(
    ("asked", "answer", "words"),
    [(400, 1, ("not armed", "TEMPORARILY_REJECTED", "commander check")), (176, 2, ("no OFFBOARD", "DENIED"))],
)
def test_what_is_refused_to_the_end_fails_with_the_vehicles_answer(asked, answer, words):
    vehicle = FakeVehicle(ack=lambda c, n: [answer if c == asked else 0], obey=lambda c, n: c != asked)
    f, report = failed(vehicle)
    assert all(word in report.reason for word in words)
    assert not vehicle.armed and f.vehicle.mode == LOITER, "left in its own hold, not in OFFBOARD"


def test_what_the_vehicle_warns_of_is_told_once_and_again_as_the_reason_why_it_does_not_arm():
    f = flight(FakeVehicle(ack=lambda c, n: [c == 400], obey=lambda c, n: c != 400))
    warning = bytes(mav.MAVLink_statustext_message(4, b"Low battery").pack(f.vehicle.tx))
    for is_time in (lambda: f.state == "takeoff", lambda: 400 in f.vehicle.counts):
        f.run_until(is_time)
        f.step(warning)
        f.step(warning)
    assert [event.text for event in f.events if event.kind == "warning"] == ["the vehicle warns: Low battery"] * 2
    assert f.run_to_end().reason.endswith("to 5 attempts; Low battery")


@pytest.mark.parametrize(("on_interrupt", "mode"), [("hold", LOITER), ("land", LAND)])
def test_a_silent_link_hands_over_all_the_same_and_is_reported(on_interrupt, mode):
    f = flight(on_interrupt=on_interrupt)
    f.run_to("mission")
    f.run_for(0.5)
    f.vehicle.silent = True
    silent_at = f.now_us
    f.run_to("aborted", 2.0)
    assert f.now_us - silent_at == pytest.approx(1_500_000, abs=50_000)
    f.run_to_end(5.0)
    assert "silent for 1.5 s" in f.report.reason
    assert f.report.outcome == "aborted"
    assert f.vehicle.mode == mode, "the request went out though nothing came in"
    since = f.now_us
    f.run_for(3.0)
    assert f.setpoints_since(since) == []


def requests(f):
    return [m.param1 for _, m in f.vehicle.commands if m.command == 511]  # SET_MESSAGE_INTERVAL


def test_a_vehicle_that_restarts_while_the_plan_is_read_has_it_made_and_agreed_to_anew():
    # Given a plan that is shown
    f = flight(confirmed=False)
    f.run_to("ready")
    asked = requests(f)
    # When the vehicle is silent for three seconds, the person says yes meanwhile, and it has begun anew, set up anew
    f.vehicle.silent = True
    f.run_for(2.0)
    assert f.companion.plan_is_ready()
    f.companion.confirm_plan()
    f.run_for(1.0)
    assert f.state == "ready", "nothing begins with a vehicle that is not heard"
    assert f.companion.core.flight.plan_confirmed and not f.companion.plan_is_ready(), "nobody is asked twice"
    f.vehicle.time_us, f.vehicle.silent, f.vehicle.loss_s = 0, False, 0.5
    # Then its streams are asked for and measured again, and nobody has agreed to the new plan
    f.run_to("connect", 0.1)
    f.run_to("ready", 10.0)
    f.run_for(2.0)
    assert f.state == "ready" and not f.vehicle.armed
    assert f.companion.plan_is_ready()
    assert requests(f) == 2 * asked and f.kinds().count("plan") == 2
    assert f.companion.core.reflex.loss_s == 0.5
    assert f.event("link").text == "the vehicle was silent: its streams are asked for again"
    # And it is flown when they have
    f.companion.confirm_plan()
    assert f.run_to_end().outcome == "completed"


@pytest.mark.parametrize(("loss_s", "said"), [(1.0, []), (3.0, [3.0])])
def test_a_com_of_loss_t_that_is_longer_than_a_setpoint_is_safe_is_told_once(loss_s, said):
    # Given a vehicle that acts so late when setpoints stop, and a link that loses the first two answers
    vehicle = FakeVehicle(loss_s=loss_s, lost_answers=2)
    # When it is flown
    flown = flight(vehicle)
    flown.run_to("mission")
    # Then that is told before take-off
    told = [event for event in flown.events if event.kind == "unattended"]
    assert [event.data["loss_s"] for event in told] == said
    assert all("it is 3 s, 2 s more than that" in event.text for event in told)
    assert vehicle.lost_answers == -1, "it was asked until it had answered"


def asked_over(trip: RoundTrip, seconds: float, start_us: int = EPOCH_US) -> list[TimeSync]:
    times = range(start_us, start_us + round(seconds * 1e6), INTERVAL_US)
    return [trip.ask(now_us) for now_us in times if now_us >= trip.due_us]


def test_it_asks_ten_times_a_second_until_a_first_answer_and_then_once():
    trip = RoundTrip()
    first = asked_over(trip, 2.0)
    assert [b.asked_ns - a.asked_ns for a, b in itertools.pairwise(first)] == [100_000_000] * 19
    trip.update(TimeSync(first[-1].asked_ns, 1), EPOCH_US + 2_000_000)
    assert len(asked_over(trip, 5.0, EPOCH_US + 2_000_000)) == 5


def trip_ms(median_ms=None, worst_ms=None, ignored=0):
    return {"median": median_ms, "worst": worst_ms, "ignored": ignored}


def test_an_answer_to_nobodys_question_and_a_second_answer_are_counted_and_no_more():
    # Given a question
    trip = RoundTrip()
    question = trip.ask(EPOCH_US)
    # When another's answer comes, then its own twice
    trip.update(TimeSync(question.asked_ns - 5_000_000_000, 1), EPOCH_US + 1_000)
    assert trip.present_us is None
    trip.update(TimeSync(question.asked_ns, 1), EPOCH_US + 3_000)
    trip.update(TimeSync(question.asked_ns, 1), EPOCH_US + 900_000)
    # Then one counts
    assert (trip.present_us, trip.summary_ms()) == (3_000, trip_ms(3.0, 3.0, 2))


def test_the_alarm_is_given_once_while_it_lasts_and_again_after_five_short_ones():
    trip, told = RoundTrip(), []
    trips_us = [2_000] * 5 + [400_000] * 6 + [2_000, 400_000] * 4 + [2_000] * 5 + [400_000] * 5
    # Given questions two seconds apart, each answered after so long
    for number, trip_us in enumerate(trips_us):
        now_us = EPOCH_US + 2_000_000 * number
        trip.update(TimeSync(trip.ask(now_us).asked_ns, 1), now_us + trip_us)
        if trip.alarm() is not None:
            told.append(number)
    assert told == [7, 26]


# --- in a flight


@pytest.mark.parametrize(
    ("vehicle", "in_the_plan", "in_the_line", "report"),
    [
        (FakeVehicle(round_trip_us=20_000), "round trip 20.0 ms", "20 ms", trip_ms(20.0, 20.0, 0)),
        # One that answers no TIMESYNC may be flown
        (FakeVehicle(does_answer_time=False), "round trip unknown: TIMESYNC is not answered", None, trip_ms()),
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
    assert (f.report.outcome, f.report.round_trip_ms) == ("completed", report)
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
    assert f.run_to_end().outcome == "completed"
    assert f.kinds().count("round_trip") == 1
    assert f.event("round_trip").data["round_trip_us"] == 400_000
    texts = [message.text for _, message in f.messages("STATUSTEXT")]
    assert texts.count("Round trip 400 ms: hits are answered late") == 1
    assert f.report.round_trip_ms["worst"] == 400.0


FAILSAFE = Heartbeat(1, 1, 2, 12, True, LOITER, 5)


@pytest.mark.parametrize(("autopilot", "chosen"), [(PX4, None), (ARDUPILOT, LOITER)])
def test_a_failsafes_mode_is_chosen_where_a_vehicle_stays_in_it_and_never_where_one_is_intended(autopilot, chosen):
    vehicle = Vehicle(autopilot=autopilot)
    vehicle.update(FAILSAFE, 0)
    assert vehicle.chosen_mode == chosen
    for sample in (CurrentMode(LOITER, OFFBOARD), FAILSAFE):
        vehicle.update(sample, 0)
    assert vehicle.chosen_mode == OFFBOARD
