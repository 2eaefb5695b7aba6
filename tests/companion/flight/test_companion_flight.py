"""Whole flights on the wire against a scripted vehicle: take-off, items, hits, recoveries, landing; their one table.

A ground station hears of them, and a fault in the program itself hands the vehicle over, setpoints going on until then.
"""

import itertools
import math

import pytest

from bench.fly.packets import decoded
from bench.fly.virtual_time import EPOCH_US
from companion.flight.context import Target
from companion.flight.handlers.progress import FlyItems
from companion.flight.operator import Texts, status_text
from companion.flight.states import FINAL_STATES, TABLE, State, Trigger
from companion.guard import states as guard_states
from companion.mavlink.encode import Encoder
from companion.messages import Severity, StatusText
from companion.report import Event
from tests.companion import fake_vehicle
from tests.companion.fake_vehicle import INTO_WALL, LANDING, TAKEOFF, at_wall, flight, flying_in, hovering, strike

BEFORE_THE_FLIGHT = {State.CONNECT, State.READY}
IN_THE_AIR = set(State) - set(FINAL_STATES) - BEFORE_THE_FLIGHT - {State.CRASHED}


@pytest.mark.parametrize("state", [state for state in State if state not in FINAL_STATES])
def test_every_state_can_be_interrupted_and_a_refusal_counts_until_the_vehicle_has_taken_off(state):
    assert TABLE[state].get(Trigger.INTERRUPTED) is State.ABORTED
    refused = State.ABORTED if state in {*BEFORE_THE_FLIGHT, State.TAKEOFF} else None
    assert TABLE[state].get(Trigger.REFUSED) is refused


@pytest.mark.parametrize("state", State)
def test_in_the_air_whoever_takes_control_has_it_and_there_alone_every_hit_is_recovered_from(state):
    assert TABLE[state].get(Trigger.COLLISION) is (State.RECOVERING if state in IN_THE_AIR else None)
    if state in IN_THE_AIR:
        assert TABLE[state].get(Trigger.CONTROL_LOST) is State.ABORTED
        assert TABLE[state].get(Trigger.CRASHED) is State.CRASHED


@pytest.mark.parametrize(
    ("table", "start", "ends"),
    [
        (TABLE, State.CONNECT, set(FINAL_STATES)),
        (guard_states.TABLE, guard_states.State.CONNECTING, {guard_states.State.ENDED}),
    ],
    ids=["flight", "guard"],
)
def test_each_state_is_reached_and_only_the_ends_have_no_way_out(table, start, ends):
    reached, frontier = {start}, [start]
    while frontier:
        for target in set(table[frontier.pop()].values()) - reached:
            reached.add(target)
            frontier.append(target)
    assert reached == set(start.__class__) == set(table)
    assert {state for state in reached if not table[state]} == ends


def test_a_mission_without_a_hit_completes():
    f = flight()
    report = f.run_to_end()
    assert (report.outcome, report.autopilot, report.collisions) == ("completed", "PX4 1.15.0", ())
    assert report.stream_rates_hz["HIGHRES_IMU"] == pytest.approx(250, rel=0.01)
    assert report.stream_rates_hz["LOCAL_POSITION_NED"] == pytest.approx(50, rel=0.01)
    assert report.started_at_us < report.armed_at_us < report.ended_at_us
    assert [k for k in f.kinds() if k not in ("mode", "item", "loss")] == [
        *("connected", "streams", "plan", "takeoff", "armed", "detector", "landing", "contact", "disarmed", "done")
    ]
    # Our heartbeat goes out every second from the first step to the last
    times = [t for t, _ in f.vehicle.heartbeats]
    assert times[0] <= 5_000_000 + 2 * 4000
    assert {b - a for a, b in itertools.pairwise(times)} == {1_000_000}
    m = f.vehicle.heartbeats[0][1]
    assert (m.type, m.get_srcComponent()) == (18, 191)


def test_coordinates_are_relative_to_where_the_vehicle_is_when_it_arms():
    f = flight(fake_vehicle.FakeVehicle(start_ned_m=(9.7, -4.0, 0.5)))
    f.run_to("takeoff")
    f.vehicle.position[0] = 10.0  # pushed while the setpoints were already streaming
    f.run_to("landing")
    assert f.report.origin_ned_m == pytest.approx((10.0, -4.0, 0.5), abs=1e-3)
    assert f.vehicle.position == pytest.approx([10.0, -2.0, -1.0], abs=0.25)
    last = f.vehicle.setpoints[-1][1]
    assert last.yaw == pytest.approx(math.pi / 2)


def test_setpoints_lead_the_mode_switch_by_a_second_never_pause_in_flight_and_end_with_the_landing():
    f = flight()
    f.run_until(lambda: f.vehicle.armed)
    assert {round(m.z, 3) for _, m in f.vehicle.setpoints} == {0.0}, "on the ground until then"
    f.run_until(lambda: "landing" in f.kinds())
    times = [t for t, _ in f.vehicle.setpoints]
    offboard_at = next(t for t, m in f.vehicle.commands if m.command == 176)
    arm_at = next(t for t, m in f.vehicle.commands if m.command == 400)
    assert offboard_at - times[0] >= 1_000_000
    assert arm_at > offboard_at
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert max(gaps) <= 50_000, "20 Hz or faster"
    assert {m.type_mask for _, m in f.vehicle.setpoints} == {0x800, 0x9F8}
    landing_at = f.now_us
    f.run_to_end()
    assert f.setpoints_since(landing_at) == []


def test_nothing_arms_before_the_plan_is_confirmed():
    f = flight(confirmed=False)
    f.run_until(f.companion.plan_is_ready)
    f.run_for(20.0)
    assert f.state == "ready"
    assert {m.command for _, m in f.vehicle.commands} <= {511, 512}
    assert f.vehicle.setpoints == []
    plan = f.companion.plan_text()
    said = ("PX4 1.15.0", "quadrotor", "take off to 1.5 m", "15 m", "6 m", "recovery law adaptive", "hold for 3 s")
    assert all(words in plan for words in (*said, "HIGHRES_IMU"))
    f.companion.confirm_plan()
    f.run_to("takeoff", 0.1)


def test_the_hit_is_answered_in_the_step_that_hears_of_it_and_reported_as_it_was():
    # Steady when it meets the wall: the accelerometer of a vehicle that stays level does not show how it speeds up.
    steady = {"flight": {"speeding_up_m_s2": 2.0}}
    f = at_wall(INTO_WALL, recovery={"law": "paper", "gamma": 0.5}, companion=steady)
    f.run_until(lambda: "detection" in f.kinds())
    contact_us = f.vehicle.contact_times_us[0]
    detection = f.event("detection")
    assert detection.data["sample_time_boot_us"] - contact_us <= 8000, "the first or second IMU sample"
    recovery = f.setpoints_since(detection.time_us - 1)
    assert recovery, "the setpoint leaves in the same step"
    _, m = recovery[-1]
    assert (m.x, m.y, m.z) == pytest.approx(detection.data["recovery_setpoint_ned_m"], abs=1e-4)
    assert m.type_mask == 0x9F8
    (hit,) = f.run_to_end().collisions
    assert hit.impact_velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.15)
    assert hit.position_ned_m == pytest.approx((3.0, 0.0, -1.5), abs=0.05)
    assert hit.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.01)
    v_n = hit.impact_velocity_ned_m_s[0]
    assert hit.recovery_setpoint_ned_m[0] == pytest.approx(hit.position_ned_m[0] - 0.5 * v_n)
    assert 45.0 < hit.peak_specific_force_m_s2 < 75.0
    assert 0.5 < hit.settled_after_s < 4.0
    assert 0.3 < hit.rebound_speed_m_s < 1.5
    assert 0.0 <= hit.overshoot_m < 0.1


@pytest.mark.parametrize(
    ("state", "after_s", "detector"), [("takeoff", 1.6, "off (below 0.5 m)"), ("landing", 2.2, "armed")]
)
def test_what_shakes_a_takeoff_or_a_landing_is_no_hit(state, after_s, detector):
    f = flight()
    f.run_to(state)
    f.run_for(after_s)
    assert f.companion.status().detector.startswith(detector)
    strike(f, 15.0, 15.0)
    f.run_to_end()
    assert f.report.collisions == () and "landing" in f.event("contact").text


def test_a_fall_to_the_ground_is_told_as_a_crash():
    f = hovering()
    f.vehicle.position[2] = -0.5
    for _ in range(10):
        f.vehicle.velocity[2] = 4.0
        f.step()
    strike(f, 60.0, 0.0)
    crash = f.event("crash")
    assert crash.data["down_m_s"] > 3.5 and "tilted by 0 degrees" in crash.text


def test_headings_turn_the_shorter_way_at_a_limited_rate():
    items = [TAKEOFF, LANDING]
    turn = {"position_ned_m": [0, 0, -1.5], "speed_m_s": 1.0}
    items[1:1] = [{"go_to": {**turn, "yaw_deg": 170}}, {"go_to": {**turn, "yaw_deg": -170}}]
    f = flight(items=items)
    f.run_until(lambda: len([e for e in f.events if e.kind == "item"]) == 2)
    began = f.vehicle.time_us
    f.run_to("landing")
    yaws = [m.yaw for t, m in f.vehicle.setpoints if t > began]
    assert all(abs(math.remainder(yaw - math.pi, math.tau)) < math.radians(20.0) for yaw in yaws)
    steps = [abs(math.remainder(b - a, math.tau)) for a, b in itertools.pairwise(yaws)]
    assert max(steps) <= math.radians(45) * 0.021


@pytest.mark.parametrize("state", ["mission", "holding", "returning"])
def test_a_vehicle_that_something_has_turned_is_turned_back_at_leisure(state):
    # Given a flight northwards
    f = flying_in(state)
    # When something turns the vehicle by 115 degrees
    f.vehicle.yaw_rad = 2.0
    f.run_for(0.1)
    # Then the heading that is asked for leads its own by what turns it at 45 degrees a second
    led_rad = math.remainder(f.vehicle.setpoints[-1][1].yaw - f.vehicle.yaw_rad, math.tau)
    assert led_rad == pytest.approx(-math.radians(45.0) / 2.8, abs=0.03)


def breaks(*arguments):
    raise ArithmeticError("the sum is not the sum")


ON_THE_WAY_OUT = ["companion.flight.core.bounded", "companion.flight.core.status_text"]
ON_THE_WAY_OUT += ["companion.mavlink.encode.Encoder._position"]


@pytest.mark.parametrize(
    ("place", "does"),
    [
        ("companion.flight.handlers.progress.FlyItems.step", breaks),
        ("companion.flight.handlers.progress.FlyItems.target", breaks),
        ("companion.flight.handlers.progress.FlyItems.target", lambda *_: Target((float("nan"), 0, 0), None)),
        ("companion.reflex.reflex.advance", breaks),
        ("companion.reflex.reflex.Reflex.follow", breaks),
        *((place, breaks) for place in ON_THE_WAY_OUT),
    ],
)
def test_whatever_breaks_in_the_air_hands_the_vehicle_over_by_setpoints_that_are_safe_to_hold(monkeypatch, place, does):
    f = flying_in("mission")
    broken_at_us, safe = f.now_us, f.setpoints_since(0)[-1][1]
    monkeypatch.setattr(place, does)
    f.companion.core.flight.report(f.now_us, "policy", "something to tell")
    f.run_to_end(3.0)
    assert f.report.outcome == "failed" and f.kinds().count("fault") <= 2
    assert f.vehicle.mode == fake_vehicle.LOITER and f.vehicle.armed
    if does is breaks:
        assert "ArithmeticError in breaks: the sum is not the sum" in f.report.reason
        assert "test_companion_flight.py" in f.event("fault").data["traceback"]
    times_us = [at_us for at_us, _ in f.setpoints_since(broken_at_us - 100_000)]
    assert max(b - a for a, b in itertools.pairwise(times_us)) <= 50_000, "no gap before the mode is seen to hold"
    assert times_us[-1] > broken_at_us or place in ON_THE_WAY_OUT
    for _, sent in f.setpoints_since(broken_at_us):
        assert math.isfinite(sent.x) and math.isnan(sent.vx) and math.isnan(sent.afx)
        assert math.dist((sent.x, sent.y, sent.z), (safe.x, safe.y, safe.z)) < 0.1, "where the last good one was"


def test_when_even_the_hand_over_breaks_silence_leaves_the_vehicle_to_its_failsafe(monkeypatch):
    f = flying_in("mission")
    monkeypatch.setattr(FlyItems, "step", breaks)
    monkeypatch.setattr("companion.flight.handlers.ending.HandOver.step", breaks)
    f.run_to_end(1.0)
    since = f.now_us
    f.run_for(2.0)
    assert f.setpoints_since(since) == []
    assert f.kinds().count("fault") == 2


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 100, 137])
def test_a_text_of_any_length_arrives_whole(length):
    text = ("0123456789" * 20)[:length]
    messages = [decoded(packet) for packet in Encoder().packets(StatusText(Severity.WARNING, text))]
    assert "".join(message.text for message in messages) == text
    assert [message.chunk_seq for message in messages] == list(range(len(messages)))
    assert len({message.id for message in messages}) == 1 and (messages[0].id == 0) is (length <= 50)
    if length > 50:
        assert len(messages[-1].text) < 50, "only a shorter part ends the text"
    assert {message.severity for message in messages} == {4}


def test_the_operator_reads_hit_recovery_and_outcome_and_has_the_detectors_state_to_plot():
    f = at_wall(INTO_WALL)
    f.run_to_end()
    texts = [message.text for _, message in f.messages("STATUSTEXT")]
    hit, collision = next(text for text in texts if text.startswith("Hit")), f.report.collisions[0]
    assert hit.startswith(f"Hit 1: at {collision.impact_speed_m_s:.2f} m/s going north, ")
    recovered = next(text for text in texts if text.startswith("Recovered"))
    assert recovered.startswith(f"Recovered in {collision.settled_after_s:.2f} s, ") and recovered.endswith("too far")
    assert texts[0] == "Mission test begins" and texts[-1] == "Mission test completed, hits: 1"
    assert all(len(text) <= 50 for text in texts)
    # The state comes twice a second, and no more after the end
    f.run_for(2.0)
    phases = [(t, m.value) for t, m in f.messages("NAMED_VALUE_FLOAT") if m.name == "rb_phase"]
    gaps = [b - a for (a, _), (b, _) in itertools.pairwise(phases)]
    assert min(gaps) >= 500_000 and max(gaps) <= 560_000
    assert {value for _, value in phases} >= {0.0, 2.0}
    states = [list(State)[round(m.value)] for _, m in f.messages("NAMED_VALUE_FLOAT") if m.name == "rb_state"]
    assert State.RECOVERING in states
    hits = [m.value for _, m in f.messages("NAMED_VALUE_FLOAT") if m.name == "rb_hits"]
    assert hits == sorted(hits) and hits[-1] == 1.0
    v_c = [m for _, m in f.messages("DEBUG_VECT") if m.name == "rb_v_c"]
    assert v_c[0].x == pytest.approx(2.0, abs=0.1)
    assert phases[-1][0] <= f.report.ended_at_us


def test_a_vehicle_hit_while_it_hovers_is_pushed():
    f = hovering()
    f.vehicle.push_m_s2 = (0.0, -12.0)
    # The setpoint goes first, the text with the next step.
    f.step()
    assert f.state == "recovering" and "Hit" not in f.messages("STATUSTEXT")[-1][1].text
    f.step()
    assert f.messages("STATUSTEXT")[-1][1].text == "Hit 1: pushed west, 12 m/s2"


@pytest.mark.parametrize(
    ("told", "sent"),
    [
        # One alone goes at once; the same again within the second not at all, and after it anew.
        ([(0, "hit", "A")], [(0, "A")]),
        ([(0, "hit", "A"), (5, "hit", "A"), (9, "hit", "A")], [(0, "A")]),
        ([(0, "hit", "A"), (10, "hit", "A")], [(0, "A"), (10, "A")]),
        # Others of the subject wait until the second is over; the latest is sent.
        ([(0, "hit", "A"), (3, "hit", "B")], [(0, "A"), (10, "B")]),
        ([(0, "hit", "A"), (3, "hit", "B"), (8, "hit", "C"), (12, "hit", "D")], [(0, "A"), (10, "C"), (20, "D")]),
        ([(0, "hit", "A"), (3, "hit", "B"), (8, "hit", "A")], [(0, "A")]),
        # Subjects do not wait for each other.
        ([(0, "hit", "A"), (1, "recovered", "R"), (2, "hit", "B")], [(0, "A"), (1, "R"), (10, "B")]),
    ],
)
def test_of_each_subject_one_text_a_second_is_sent_and_none_twice(told, sent):
    # Given texts about subjects that are told then, and what is sent when, in tenths of a second
    texts, heard = Texts(), []
    for tenth in range(40):
        now = [(subject, StatusText(Severity.WARNING, text)) for at, subject, text in told if at == tenth]
        heard += [(tenth, text.text) for text in texts.due(now, False, EPOCH_US + tenth * 100_000)]
    assert heard == sent


@pytest.mark.parametrize(
    ("kind", "severity"),
    [("link", 4), ("take_over", 4), ("let_go", 4), ("given_back", 5), ("policy", 5), ("envelope", 5), ("mode", None)],
)
def test_what_a_pilot_may_have_to_act_on_warns_and_what_goes_as_planned_does_not(kind, severity):
    text = status_text(Event(EPOCH_US, kind, "something is so", {}), "test", 0)
    assert text == (None if severity is None else StatusText(Severity(severity), "Something is so"))


def test_a_text_that_waits_leaves_when_its_second_is_over_and_with_the_flights_end_at_once():
    f = hovering()
    for text in ("first", "second"):
        f.companion.note("late", text)
        f.step()
    f.run_for(1.5)
    times = {message.text: t for t, message in f.messages("STATUSTEXT")}
    assert times["Second"] - times["First"] == 1_000_000
    for text in ("third", "fourth"):
        f.companion.note("late", text)
        f.step()
    f.companion.stop("Ctrl-C")
    f.run_to_end(0.5)
    assert "Fourth" in [message.text for _, message in f.messages("STATUSTEXT")]
