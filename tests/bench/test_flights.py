"""A corpus of recorded flights: what was reported, against labels."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from bench.main import main
from bench.rows.tables import at_most_an_hour
from bench.studies.flights import Event, events, mistakes, table
from companion.mission.config import CompanionConfig
from rebound_cli.replay.report import replay_log
from tests.rebound_cli.replay.flying import HIT_US, flight


def event(at_s, told):
    return Event(at_s, told, [SimpleNamespace(at_us=at_s * 1e6)])


def test_a_label_is_met_by_an_event_of_its_class_near_it():
    found = [event(10.0, "touchdown"), event(20.0, "crash")]
    assert list(mistakes(found, {10.4: "touchdown", 20.9: "crash"})) == []
    assert list(mistakes(found[:1], {10.0: "crash"})) == ["crash at 10.0 s told as touchdown"]
    assert list(mistakes(found[:1], {40.0: "crash"})) == ["crash at 40.0 s told as nothing"]


@pytest.mark.parametrize("told", ["collision", "crash"])
def test_a_collision_or_a_crash_without_a_label_is_one_where_nothing_was(told):
    assert list(mistakes([event(10.0, told)], {})) == [f"{told} at 10.0 s, where nothing was"]
    assert list(mistakes([event(10.0, told)], {10.2: told})) == []
    # Landings are many, and nobody labels them all
    assert list(mistakes([event(10.0, "touchdown")], {})) == []


def test_what_follows_within_two_seconds_is_one_event():
    replay = replay_log(flight(), CompanionConfig(), None)
    (hit,) = replay.findings.impacts
    replay.findings.impacts += [replace(hit, at_us=hit.at_us + 1_500_000), replace(hit, at_us=hit.at_us + 4_000_000)]
    first, second = events(replay)
    assert first.at_s == pytest.approx(HIT_US * 1e-6, abs=0.01)
    assert (len(first.findings), len(second.findings)) == (2, 1)


def test_the_bound_on_no_event_is_three_an_hour():
    assert at_most_an_hour(0, 1.0) == pytest.approx(3.0, abs=0.01)
    assert at_most_an_hour(0, 1.5) < 2.0


def test_a_log_that_cannot_be_read_is_named_and_a_folder_without_logs_is_an_error(tmp_path, capsys):
    (tmp_path / "empty.bin").write_bytes(b"")
    assert main(["flights", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "the file is empty" in (tmp_path / "out" / "flights.md").read_text()


def test_the_table_of_no_rows_promises_nothing():
    assert "an hour" not in table([])
