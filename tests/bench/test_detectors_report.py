"""`python -m bench detectors` from end to end, small; and its verdicts on made-up results."""

import dataclasses

import pytest

from bench.campaign import run as running
from bench.campaign.plan import work_out
from bench.detectors import campaigns, pilot
from bench.detectors import flights as flown
from bench.detectors.flights import FlightCase
from bench.detectors.hits import draw_case
from bench.detectors_report.bars import MET, MISSED, REPORTED, Bar, summary_text
from bench.detectors_report.comparison import comparison_bars
from bench.detectors_report.flights import flight_bars
from bench.detectors_report.hit_bars import hit_bars
from bench.detectors_report.numbers import Hits, per_cent
from bench.main import main

pytestmark = pytest.mark.slow

ENTRY = {
    "false": 0,
    "blind": 0,
    "latency_ms": 2.0,
    "samples_late": 0,
    "evidence": "force",
    "speed_error_m_s": 0.02,
    "velocity_error_m_s": 0.03,
    "normal_error_deg": 5.0,
    "first_normal_error_deg": 5.0,
    "time_error_ms": 0.5,
    "bound": False,
    "impulse": 1.0,
}


def made_up(count=200, **changes):
    """As many hits, all seen perfectly by fused, or with changes in the first."""
    cases = [draw_case("plain", seed, ("fused", "threshold")) for seed in range(count)]
    cases = [dataclasses.replace(case, speed_m_s=2.5) for case in cases]
    results = {}
    for number in range(count):
        fused = {**ENTRY, **changes} if number < 2 else dict(ENTRY)
        fused = {key: value for key, value in fused.items() if value is not None}
        late = {**ENTRY, "latency_ms": 40.0}
        rate = {"possible_ms": 2.0, "detectors": {"fused": fused, "threshold": late}, "swept": {}}
        results[number] = {"speed_m_s": 2.5, "off_head_on_deg": 10.0, "clipped": False, "contact_s": 0.05}
        results[number]["rates"] = {"50": rate, "100": rate, "246": rate}
    return Hits(cases, results)


def verdicts(bars, word):
    return {bar.what: bar.verdict for bar in bars if word in bar.what}


def test_perfect_hits_meet_every_bar():
    assert {bar.verdict for bar in hit_bars(made_up()) if bar.is_met is not None} == {MET}


def test_one_missed_hit_in_a_hundred_is_too_many_but_at_a_low_rate():
    # Given one hit in a hundred that is not found, for both airframes
    found = verdicts(hit_bars(made_up(latency_ms=None)), "detected")
    assert found["foldable, 50 Hz, 0.5 to 5 m/s: detected"] == MISSED
    assert found["rigid, 246 Hz, 0.5 to 5 m/s: detected"] == MISSED
    assert found["rigid, 100 Hz, 0.5 to 5 m/s: detected"] == MISSED
    assert found["rigid, 50 Hz, 0.5 to 5 m/s: detected"] == MET


def test_one_sample_late_may_be_one_in_a_hundred_two_samples_none():
    assert set(verdicts(hit_bars(made_up(samples_late=1)), "first sample").values()) == {MET}
    assert set(verdicts(hit_bars(made_up(samples_late=2)), "first sample").values()) == {MISSED}
    assert set(verdicts(hit_bars(made_up(100, samples_late=1)), "first sample").values()) == {MISSED}


def test_one_wild_velocity_misses_the_bar_and_six_wild_normals_in_a_hundred():
    assert set(verdicts(hit_bars(made_up(speed_error_m_s=1.0)), ": v_c").values()) == {MISSED}
    few = verdicts(hit_bars(made_up(normal_error_deg=90.0)), "foldable, 50 Hz, unclipped: normal")
    many = verdicts(hit_bars(made_up(32, normal_error_deg=90.0)), "foldable, 50 Hz, unclipped: normal")
    assert set(few.values()) == {MET, REPORTED} and set(many.values()) == {MISSED, REPORTED}


def healthy(hours, *alarms):
    cases = [FlightCase("calm", 0, "foldable", ("fused", "threshold"))]
    entry = {"alarms": list(alarms), "touches": 0, "blind": 0}
    noisy = {"alarms": [[1.0, "landing", "hit"]] * 3, "touches": 0, "blind": 0}
    rates = {rate: {"fused": entry, "threshold": noisy} for rate in ("50", "100", "246")}
    return cases, {0: {"seconds": 3600.0 * hours, "rates": rates}}


def test_ten_quiet_hours_meet_the_bar_one_says_nothing_and_one_alarm_misses_it():
    assert {bar.verdict for bar in flight_bars(*healthy(10.0))} == {MET}
    assert {bar.verdict for bar in flight_bars(*healthy(1.0))} == {REPORTED}
    assert {bar.verdict for bar in flight_bars(*healthy(1.0, [3.0, "dash", "wall"]))} == {MISSED}


def test_the_baseline_is_beaten_only_by_being_ten_times_earlier_with_less_misses_and_alarms():
    earlier, with_misses, misses, alarms = comparison_bars(made_up(), *healthy(10.0))
    assert with_misses.verdict == REPORTED
    assert earlier.verdict == MET and earlier.measured.startswith("20.0 times")
    assert misses.verdict == MISSED  # neither missed any
    assert alarms.verdict == MET


def test_a_hundred_per_cent_is_said_only_of_all():
    assert per_cent(1.0, 2) == "100.00" and per_cent(0.99999, 2) == "99.99" and per_cent(0.5) == "50.0"


def test_missed_bars_are_named_on_the_terminal():
    text = summary_text(
        [Bar("speed", "≤ 1", "2", False, "9 hits"), Bar("height", "≤ 1", "1", True), Bar("x", "", "", None)]
    )
    assert "1 of 2 bars are met" in text and "missed: speed: wanted ≤ 1, measured 2 (9 hits)" in text


def test_the_command_writes_tables_and_pictures(tmp_path, monkeypatch, capsys):
    # Given a bench that is small and stays in this process
    def outcomes(campaign, missing, workers):
        yield from work_out(campaign.work_out, missing)

    monkeypatch.setattr(running, "_outcomes", outcomes)
    monkeypatch.setattr(campaigns, "detector_names", lambda: ("fused", "threshold"))
    monkeypatch.setattr(flown, "AIRBORNE_S", 1.0)
    monkeypatch.setattr(pilot, "FLOOR_M", 3.5)
    monkeypatch.setattr(pilot, "CEILING_M", 5.0)
    monkeypatch.setattr(pilot, "RADIUS_M", 6.0)
    monkeypatch.chdir(tmp_path)
    # When it is run twice
    command = ["detectors", "--hits", "4", "--hours", "0.01", "--out", str(tmp_path / "docs")]
    assert main(command) == 0
    first = (tmp_path / "docs" / "detection.md").read_text()
    assert main(command) == 0
    # Then both detectors are in the tables, the pictures are there, and the second run says the same
    assert (tmp_path / "docs" / "detection.md").read_text() == first
    for name in ("fused", "threshold"):
        assert f"| {name} | foldable | 246 |" in first
    assert "python -m bench detectors --hits 4 --hours 0.01" in first
    assert {path.name for path in (tmp_path / "docs" / "images" / "detection").iterdir()} == {
        *("roc.png", "speed.png", "latency.png"),
    }
    assert "bars are met" in capsys.readouterr().out
