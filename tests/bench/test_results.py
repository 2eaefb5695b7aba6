"""The table of results: what one flight adds to it, and what it says of many."""

from dataclasses import asdict

import pytest

from bench.fly.campaign import Results
from bench.main import main
from bench.studies.paper import results
from bench.studies.paper.results import ResultsCase, case_document, fly_case, results_table

pytestmark = pytest.mark.slow


def test_the_papers_detector_law_and_gain_are_stated_in_every_flight():
    data = case_document(ResultsCase("rigid", 2.5, 7)).data
    assert data["companion"]["detector"] == "lateral"
    assert (data["recovery"]["law"], data["recovery"]["gamma"]) == ("paper", 0.5)


def test_one_flight_gives_the_figures_of_its_hit():
    figures = fly_case(ResultsCase("foldable", 1.5, 3))
    assert figures["is_completed"]
    assert (figures["contacts"], figures["false_detections"], figures["recontacts"]) == (1, 0, 0)
    (hit,) = figures["hits"]
    assert hit["is_first_possible_sample"]
    assert 0.0 < hit["latency_ms"] < 9.0
    assert abs(hit["speed_error"]) < 0.15


def hit(**changes):
    values = {
        "is_first_possible_sample": True,
        "latency_ms": 2.0,
        "speed_error": 0.03,
        "rebound_speed_m_s": 0.3,
        "overshoot_m": 0.01,
        "peak_force_n": 100.0,
    }
    return values | changes


def case(seed, *hits, **changes):
    values = {"is_completed": True, "contacts": 1, "false_detections": 0, "recontacts": 0}
    return {"case": asdict(ResultsCase("foldable", 2.0, seed)), "hits": list(hits)} | values | changes


def test_a_row_counts_all_flights_and_takes_the_worst_where_the_worst_matters():
    # Given two flights, one with a late detection and one with a missed contact
    late = hit(is_first_possible_sample=False, latency_ms=6.0, speed_error=-0.04, overshoot_m=0.03)
    figures = [case(1, hit(), late, contacts=2, recontacts=1), case(2, is_completed=False)]
    # When the table is written
    head, _, row = results_table(Results(dict(enumerate(figures)), {})).splitlines()
    cells = {name.strip(): cell.strip() for name, cell in zip(head.split("|"), row.split("|"), strict=True)}
    # Then nothing is left out
    assert (cells["completed"], cells["hits"], cells["detected"], cells["recontacts"]) == ("1 of 2", "3", "2", "1")
    assert cells["at the first possible sample"] in ("1", "1.0") and cells["latency, mean / max [ms]"] == "4.0 / 6.0"
    assert (cells["v_c error, RMS [%]"], cells["overshoot, max [m]"]) == ("3.5", "0.030")


def test_a_place_that_cannot_be_written_to_is_said_before_anything_is_flown(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(results, "run_campaign", lambda *_: pytest.fail("flown"))
    (tmp_path / "page.md").mkdir()
    assert main(["paper", "results", "--out", str(tmp_path / "page.md")]) == 1
    assert capsys.readouterr().err == f"bench: {tmp_path / 'page.md'} cannot be written to.\n"
