"""`python -m bench detectors`: its verdicts on made-up rows, and from end to end, small."""

import dataclasses

import pandas as pd
import pytest

from bench.cases.hits import draw_case
from bench.fly.campaign import Results
from bench.fly.wire import ASKED_HZ
from bench.main import main
from bench.rows.tables import MET, MISSED, REPORTED
from bench.studies.detectors import all_bars, rows

pytestmark = pytest.mark.slow

FOUND = {"false": 0, "touches": 0, "latency_ms": 2.0, "samples_late": 0}
FOUND |= {"speed_error_m_s": 0.01, "normal_error_deg": 3.0}
BY = ("fused", "threshold")


def frame(cases, results):
    return rows(Results([*zip(cases, results, strict=True)]))


def bars(count=200, **changes):
    """Perfect hits of either airframe; the first two hits are changed."""
    cases = [dataclasses.replace(draw_case(seed, False), speed_m_s=2.5) for seed in range(count)]
    truth = {"true_speed_m_s": 2.5, "possible_ms": 2.0}
    hits = []
    for case in cases:
        ours = {**FOUND, **(changes if case.seed < 2 else {})}
        theirs = FOUND | {"latency_ms": None if case.seed < 4 else 40.0}
        hits.append(at_each_rate({**truth, "detector": "fused", **ours}, {**truth, "detector": "threshold", **theirs}))
    return all_bars(frame(cases, hits))


def at_each_rate(*rows):
    return {"rows": [{**row, "rate": rate} for rate in ASKED_HZ for row in rows]}


def verdicts(found, word):
    return {bar.verdict for bar in found if word in bar.what} - {REPORTED}


def test_perfect_hits_meet_every_bar():
    assert {bar.verdict for bar in bars()} == {MET}


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"latency_ms": None}, "0.5 to 5 m/s: detected"),
        ({"samples_late": 2}, "at the first sample that shows it"),
        ({"speed_error_m_s": 2.0}, ": v_c"),
    ],
)
def test_each_figure_has_its_bar(changes, word):
    assert MISSED in verdicts(bars(**changes), word)


def test_the_command_writes_tables_and_rows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["detectors", "--hits", "4", "--jobs", "1", "--out", "page"]) == 0
    text = (tmp_path / "page" / "detectors.md").read_text()
    assert "`python -m bench detectors --hits 4 --jobs 1 --out page`" in text
    assert "## Every detector on simulated hits" in text and "bars are met" in capsys.readouterr().out
    table = pd.read_json(tmp_path / "page" / "detectors.jsonl", lines=True)
    assert {*table["detector"]} >= {*BY} and {*table["rate"]} == {*ASKED_HZ}
