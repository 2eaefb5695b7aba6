"""The corpus: a flight is kept as bytes and truth, judged from its bytes, and two versions' verdicts are told apart."""

import copy
import json
from types import SimpleNamespace

import pytest

from bench.cases.missions import MissionCase
from bench.main import main
from bench.studies import corpus
from bench.studies.corpus import comparison_text, record, verdict
from companion.reflex.normal import Normal
from rebound_cli.replay.watching import Findings
from rebound_cli.results.run_folder import TLOG_NAME, TRUTH_NAME
from sim_vehicle.shell.truth_file import load_truth
from tests.bench.random_missions.made_up import hit

# The first random mission, of a drawn vehicle, in which something is hit.
CASE = MissionCase(70003, "foldable", is_drawn=True)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus") / "flight"
    record((folder, CASE))
    return folder


@pytest.fixture(scope="module")
def verdicts(flight, tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["corpus", "judge", str(flight.parent), "--out", "verdicts.json"]) == 0
    return json.loads((folder / "verdicts.json").read_text())


@pytest.mark.slow
def test_a_flight_is_judged_from_its_bytes_against_its_truth(flight, verdicts):
    # Given a recorded flight with hits
    hits, _, _ = load_truth(flight / TRUTH_NAME)
    assert hits
    # When it is heard again, as recorded and at 50 Hz
    rates = verdicts["flights"]["flight"]["rates"]
    # Then each true hit has its row, with what was told of it, and nothing else was told
    for rate, most_late_ms in (("recorded", 10.0), ("50", 45.0)):
        rows = rates[rate]["hits"]
        assert [row["contact_boot_us"] for row in rows] == [round(hit.contact_at_boot_us) for hit in hits]
        assert all(0.0 <= row["latency_ms"] <= most_late_ms for row in rows)
        assert rates[rate]["false_boot_us"] == []


def finding(at_s, is_collision=True):
    told = SimpleNamespace(
        impact=SimpleNamespace(sample_time_boot_us=round(at_s * 1e6)),
        velocity_ned_m_s=(2.0, 0.0, 0.0),
        normal=Normal((-1.0, 0.0, 0.0), 0.2),
    )
    return SimpleNamespace(is_collision=is_collision, first=told, final=told)


def test_a_collision_that_is_told_twice_or_of_nothing_is_false():
    # Given a hit that is told twice, one that is not told, something told of nothing, and a touch that is no collision
    hits = [hit(at_s=10.0), hit(at_s=14.0)]
    told = [finding(10.004), finding(10.02), finding(12.0), finding(13.0, is_collision=False)]
    # When they are set against each other
    found = verdict(Findings(impacts=told), hits)
    # Then the first is the hit's, 4 ms late
    assert found["false_boot_us"] == [10_020_000, 12_000_000]
    assert [row.get("latency_ms") for row in found["hits"]] == [4.0, None]


def test_drawn_vehicles_of_both_kinds_fly_a_mission_of_each_seed(monkeypatch, tmp_path):
    flown = []
    monkeypatch.setattr(corpus, "worked_out", lambda work, places, workers: flown.extend(places))
    words = ["--missions", "2", "--first-seed", "7"]
    assert main(["corpus", "record", str(tmp_path / "corpus"), *words]) == 0
    assert [(folder.name, case.seed, case.airframe, case.is_drawn) for folder, case in flown] == [
        (f"{kind}-{seed}", seed, kind, True) for seed in (7, 8) for kind in ("foldable", "rigid")
    ]


@pytest.mark.slow
def test_a_flight_that_is_there_is_not_flown_again(flight):
    before = (flight / TLOG_NAME).stat().st_mtime_ns
    record((flight, CASE))
    assert (flight / TLOG_NAME).stat().st_mtime_ns == before


@pytest.mark.slow
def test_a_hit_that_is_lost_and_a_false_one_are_told(verdicts, tmp_path, capsys):
    # Given a version that misses the first hit at 50 Hz and tells one that is none
    worse = copy.deepcopy(verdicts)
    heard = worse["flights"]["flight"]["rates"]["50"]
    for key in ("latency_ms", "velocity_error_m_s", "normal_error_deg"):
        del heard["hits"][0][key]
    heard["false_boot_us"].append(12_000_000)
    for name, content in (("old.json", verdicts), ("new.json", worse)):
        (tmp_path / name).write_text(json.dumps(content))
    # When both are compared
    assert main(["corpus", "compare", str(tmp_path / "old.json"), str(tmp_path / "new.json")]) == 0
    # Then the flight is named with what changed, and of the same version nothing has
    assert "flight, 50: 0 hits won, 1 lost, +1 told that are none" in capsys.readouterr().out
    assert "flight," not in comparison_text(verdicts, verdicts)


@pytest.mark.parametrize("words", [["judge", "FOLDER", "--out", "FOLDER/v.json"], ["compare", "FOLDER/a", "FOLDER/b"]])
def test_a_folder_or_a_file_with_nothing_in_it_is_one_sentence(words, tmp_path, capsys):
    assert main(["corpus", *(word.replace("FOLDER", str(tmp_path)) for word in words)]) == 1
    told = capsys.readouterr().err
    assert str(tmp_path) in told and len(told.strip().splitlines()) == 1
