"""A corpus of recorded flights: what was reported, against labels."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from bench.main import main
from bench.studies.flights import Event, events, mistakes
from companion.mission.config import CompanionConfig
from companion.reflex.detector import ImpactKind
from rebound_cli.replay.report import replay_log
from tests.rebound_cli.replay.flying import HIT_US, flight


def event(at_s, told, late_s=None):
    return Event(at_s, told, [SimpleNamespace(at_us=at_s * 1e6)], late_s)


def test_a_label_is_met_by_an_event_of_its_class_near_it():
    found = [event(10.0, "touchdown"), event(20.0, "crash")]
    assert list(mistakes(found, {10.4: "touchdown", 20.9: "crash"})) == []
    assert list(mistakes(found[:1], {10.0: "crash"})) == ["crash at 10.0 s told as touchdown"]
    assert list(mistakes(found[:1], {40.0: "crash"})) == ["crash at 40.0 s told as nothing"]


@pytest.mark.parametrize("told", ["collision", "crash"])
def test_a_collision_or_a_crash_without_a_label_is_one_where_nothing_was(told):
    assert list(mistakes([event(10.0, told)], {})) == [f"{told} at 10.0 s, where nothing was"]
    assert list(mistakes([event(10.0, told)], {10.2: "nothing"})) == [f"{told} at 10.0 s, where nothing was"]
    assert list(mistakes([event(10.0, told)], {10.2: told})) == []
    # Landings are many, and nobody labels them all
    assert list(mistakes([event(10.0, "touchdown")], {})) == []


def test_a_crash_that_is_told_long_after_its_hardest_moment_is_told_late():
    labels = {10.0: "crash"}
    assert list(mistakes([event(10.0, "crash", late_s=0.1)], labels)) == []
    assert list(mistakes([event(10.0, "crash", late_s=-0.6)], labels)) == []
    assert list(mistakes([event(10.0, "crash", late_s=0.6)], labels)) == ["crash at 10.0 s told 0.60 s late"]


def test_how_late_a_crash_is_told_counts_from_its_hardest_sample():
    replay = replay_log(flight(), CompanionConfig())
    (hit,) = replay.findings.impacts
    assert not hit.is_crash and next(events(replay)).late_s is None
    crash = replace(hit.first, impact=replace(hit.first.impact, kind=ImpactKind.CRASH))
    hardest_us, _ = max(replay.log.imu(), key=lambda item: math.hypot(*item[1].specific_force_frd_m_s2))
    replay.findings.impacts[:] = [replace(hit, at_us=hardest_us + 300_000, first=crash)]
    assert next(events(replay)).late_s == pytest.approx(0.3)


def test_what_follows_within_two_seconds_is_one_event():
    replay = replay_log(flight(), CompanionConfig())
    (hit,) = replay.findings.impacts
    replay.findings.impacts += [replace(hit, at_us=hit.at_us + 1_500_000), replace(hit, at_us=hit.at_us + 4_000_000)]
    first, second = events(replay)
    assert first.at_s == pytest.approx(HIT_US * 1e-6, abs=0.01)
    assert (len(first.findings), len(second.findings)) == (2, 1)


def test_a_log_that_cannot_be_read_is_named_and_a_folder_without_logs_is_an_error(tmp_path, capsys):
    (tmp_path / "empty.bin").write_bytes(b"")
    assert main(["flights", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "the file is empty" in (tmp_path / "out" / "flights.md").read_text()
