"""What a ground station hears: texts with numbers for hit, recovery and outcome, and the detector's state to plot."""

import itertools

import pytest

from bench.fly.packets import decoded
from bench.fly.virtual_time import EPOCH_US
from companion.flight.operator import Texts, status_text
from companion.flight.states import State
from companion.mavlink.encode import Encoder
from companion.messages import Severity, StatusText
from companion.report import Event
from tests.companion.fake_vehicle import INTO_WALL, at_wall, hovering


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


def test_the_operator_reads_hit_recovery_and_outcome():
    f = at_wall(INTO_WALL)
    f.run_to_end()
    texts = [message.text for _, message in f.messages("STATUSTEXT")]
    hit, collision = next(text for text in texts if text.startswith("Hit")), f.report.collisions[0]
    assert hit.startswith(f"Hit 1: at {collision.impact_speed_m_s:.2f} m/s going north, ")
    recovered = next(text for text in texts if text.startswith("Recovered"))
    assert recovered.startswith(f"Recovered in {collision.settled_after_s:.2f} s, ") and recovered.endswith("too far")
    assert texts[0] == "Mission test begins" and texts[-1] == "Mission test completed, hits: 1"
    assert all(len(text) <= 50 for text in texts)


def test_a_vehicle_hit_while_it_hovers_is_pushed():
    f = hovering()
    f.vehicle.push_m_s2 = (0.0, -12.0)
    f.step()
    assert f.messages("STATUSTEXT")[-1][1].text == "Hit 1: pushed west, 12 m/s2"


def test_the_detectors_state_is_there_to_plot_twice_a_second_and_no_more_after_the_end():
    f = at_wall(INTO_WALL)
    f.run_to_end()
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


def warning(text):
    return StatusText(Severity.WARNING, text)


def spoken(steps):
    """What is sent when, in tenths of a second, of texts about a subject that are told then."""
    texts, heard = Texts(), []
    for tenth in range(40):
        told = [(subject, warning(text)) for at, subject, text in steps if at == tenth]
        heard += [(tenth, text.text) for text in texts.due(told, False, EPOCH_US + tenth * 100_000)]
    return heard


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
    assert spoken(told) == sent


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
