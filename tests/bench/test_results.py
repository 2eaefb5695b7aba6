"""The table of results: what one flight adds to it, and what it says of many."""

import pytest

from bench.main import main
from bench.paper import results
from bench.paper.results import CaseFigures, HitFigures, ResultsCase, case_document, fly_case, results_text

pytestmark = pytest.mark.slow


def test_the_papers_detector_law_and_gain_are_stated_in_every_flight():
    data = case_document(ResultsCase("rigid", 2.5, 7)).data
    assert data["companion"]["detector"] == "lateral"
    assert (data["recovery"]["law"], data["recovery"]["gamma"]) == ("paper", 0.5)


def test_one_flight_gives_the_figures_of_its_hit():
    figures = fly_case(ResultsCase("foldable", 1.5, 3))
    assert figures.is_completed
    assert (figures.contacts, figures.false_detections, figures.recontacts) == (1, 0, 0)
    (hit,) = figures.hits
    assert hit.is_first_possible_sample
    assert 0.0 < hit.latency_ms < 9.0
    assert abs(hit.speed_error) < 0.15


def hit(**changes):
    values = {
        "is_first_possible_sample": True,
        "latency_ms": 2.0,
        "speed_error": 0.03,
        "rebound_speed_m_s": 0.3,
        "overshoot_m": 0.01,
        "peak_force_n": 100.0,
    }
    return HitFigures(**(values | changes))


def case(seed, *hits, **changes):
    values = {"is_completed": True, "contacts": 1, "false_detections": 0, "recontacts": 0}
    return CaseFigures(case=ResultsCase("foldable", 2.0, seed), hits=hits, **(values | changes))


def test_a_row_counts_all_flights_and_takes_the_worst_where_the_worst_matters():
    # Given two flights, one with a late detection and one with a missed contact
    late = hit(is_first_possible_sample=False, latency_ms=6.0, speed_error=-0.04, overshoot_m=0.03)
    figures = [case(1, hit(), late, contacts=2, recontacts=1), case(2, is_completed=False)]
    # When the table is written
    text = results_text(figures, seeds=2)
    row = next(line for line in text.splitlines() if line.startswith("| 2 |"))
    # Then nothing is left out
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells == ["2", "1 of 2", "3", "2", "1", "4.0 / 6.0", "0", "1", "3.5", "0.30", "0.030", "100"]
    assert "--seeds 2" in text


def test_flights_without_hits_leave_empty_cells():
    row = next(line for line in results_text([], seeds=20).splitlines() if line.startswith("| 1 |"))
    assert [cell.strip() for cell in row.strip("|").split("|")][:3] == ["1", "0 of 0", "0"]


def test_a_place_that_cannot_be_written_to_is_said_before_anything_is_flown(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(results, "in_processes", lambda *_: pytest.fail("flown"))
    assert main(["paper", "results", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"bench: {tmp_path} cannot be written to.\n"
