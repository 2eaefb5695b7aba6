"""A vehicle at the end of a slow link: 200 ms each way are a refusal before take-off and an alarm in flight."""

import pytest

from companion.companion import Companion
from companion.guard.states import State
from rebound_cli.inputs import mission_from, world_from
from rebound_cli.results.summary import FlightFacts, Flown, build_summary
from sim_vehicle.vehicle import SimulatedVehicle
from tests.guard.flying import Air
from tests.missions.test_missions import FOLDER, load_document

pytestmark = pytest.mark.flight

EPOCH_US = 1_600_000_000_000_000
FAR = {"kind": "wire", "delay_s": 0.2}


def flown(fault):
    """The companion after square.yaml, its events, and whether the vehicle was ever armed."""
    document = load_document(FOLDER / "square.yaml")
    document.data["sim"]["faults"] = [fault] if fault else []
    world = world_from(document)
    companion = Companion(mission_from(document, world))
    vehicle = SimulatedVehicle(world.airframe, world.scene, world.seed)
    companion.confirm_plan()
    pending, events, was_armed = b"", [], False
    while not companion.finished:
        frames = vehicle.step(pending)
        result = companion.step(b"".join(frames), EPOCH_US + vehicle.time_boot_us)
        pending = b"".join(result.sent_frames)
        events += result.events
        was_armed = was_armed or companion.armed is True
        assert vehicle.time_boot_us < 200e6
    return companion, events, was_armed


def test_a_healthy_flights_round_trip_is_an_interval_of_the_simulation():
    companion, events, _ = flown(None)
    report = companion.report()
    assert report.outcome == "completed" and "round_trip" not in [event.kind for event in events]
    assert report.round_trip.median_us == report.round_trip.worst_us == 4_000
    facts = FlightFacts("square", "foldable", 1, 0.5)
    assert build_summary(Flown(report, 1.0, None), facts)["round_trip_ms"] == {
        "median": 4.0,
        "worst": 4.0,
        "ignored": 0,
    }


def test_200_ms_each_way_are_refused_before_take_off():
    companion, _, was_armed = flown({**FAR, "at_s": 0})
    report = companion.report()
    assert report.outcome == "failed" and not was_armed
    assert report.reason.startswith("the round trip to the vehicle takes 404 ms and at most 100 ms are allowed")


def test_200_ms_each_way_in_flight_are_told_once():
    companion, events, was_armed = flown({**FAR, "at_s": 20})
    told = [event for event in events if event.kind == "round_trip"]
    assert was_armed and len(told) == 1
    # three answers of five, which are asked for once a second, and the one on its way
    assert 22.0 < (told[0].time_us - EPOCH_US) / 1e6 < 25.0
    assert companion.report().round_trip.worst_us == 404_000


# --- the guard


def test_a_guard_does_not_begin_at_the_end_of_a_slow_link():
    air = Air(scene={"faults": [{**FAR, "at_s": 0}]})
    air.until(lambda: air.guard.finished, 30.0)
    assert air.guard.outcome.startswith("the round trip to the vehicle takes 404 ms and at most 100 ms are allowed")


def test_a_guard_tells_of_a_link_that_became_slow_and_watches_on():
    air = Air(scene={"faults": [{**FAR, "at_s": 15}]})
    air.take_off()
    assert air.time_s < 15.0 and air.told("round_trip") == []
    air.until(lambda: air.told("round_trip") != [], 25.0)
    air.run(3.0)
    assert air.state is State.WATCHING
    assert air.told("round_trip") == ["round trip 404 ms: hits are answered late"]
    assert air.guard.round_trip().summary()["worst"] == pytest.approx(404.0)


def test_a_guard_on_the_ground_does_not_go_in_while_the_link_is_slow():
    # Given a guard that stands by, and a link that became slow
    air = Air(scene={"faults": [{**FAR, "between_s": [8, 26]}]})
    air.until(lambda: air.state is State.STANDING_BY, 8.0)
    air.until(lambda: air.time_s > 14.0, 20.0)
    # When the vehicle takes off
    for action in (lambda: air.command(400, 1), lambda: air.command(22)):
        action()
        air.run(3.0)
    # Then the guard says why it stands by, and watches when the link is quick again
    air.run(5.0)
    assert air.state is State.STANDING_BY
    assert air.told("standing_by")[-1] == "standing by: the round trip to the vehicle takes too long"
    air.until(lambda: air.state is State.WATCHING, 40.0)
    assert air.time_s > 26.0
