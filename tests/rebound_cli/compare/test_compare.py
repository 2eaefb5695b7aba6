"""`rebound compare`: every law at every speed, and what is told of it."""

import csv
from argparse import Namespace
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from unittest.mock import Mock

import pytest
from distributed import LocalCluster

from rebound_cli.arguments import speeds_m_s
from rebound_cli.compare.cases import Case
from rebound_cli.compare.command import _flown
from rebound_cli.compare.rows import lines_of, row_of
from rebound_cli.main import main
from tests.rebound_cli.command import assert_one_clear_sentence, run_here


@pytest.mark.flight
def test_two_laws_are_flown_told_of_and_kept(tmp_path):
    out = tmp_path / "compared"
    done = run_here("compare", "wall", "--laws", "paper,adaptive", "--speeds", "1.5,1.5", "--seeds", "1", "--out", out)
    assert done.returncode == 0, done.stderr
    # Then there was progress, in a pipe as on a terminal
    assert "1 of 2," in done.stdout and "2 of 2,    0 s to go:" in done.stdout
    assert (out / "progress.txt").read_text() in done.stdout
    with (out / "compare.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["law"] for row in rows] == ["paper", "adaptive"]
    for row in rows:
        assert float(row["impact_speed_m_s"]) == pytest.approx(1.5, rel=0.1)
        assert (out / row["report"]).exists() and f'xlink:href="{row["report"]}"' in (out / "compare.html").read_text()


@pytest.mark.flight
def test_a_dask_scheduler_s_workers_fly_as_this_machine_s_cores_do(tmp_path):
    # Given a cluster of one worker with two threads
    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster:
        words = ("compare", "wall", "--seeds", "2", "--out", tmp_path / "there", "--scheduler")
        done = run_here(*words, cluster.scheduler_address)
    assert done.returncode == 0, done.stderr
    # Then each flight is as this process flies it
    flown = run_here("fly", "wall", "--lockstep", "--seed", "2", "--out", tmp_path / "here")
    assert flown.returncode == 0 and "foldable airframe, seed 2" in flown.stdout
    there, here = (tmp_path / run / "flight.tlog" for run in ("there/as-written-seed-2", "here"))
    assert there.read_bytes() == here.read_bytes()


def test_what_was_flown_before_a_worker_was_killed_is_kept(tmp_path):
    # Given a worker that is killed in the second flight, as for the memory that it takes
    cases = [Case("paper", None, seed, ()) for seed in (1, 2)]
    done, killed = Future(), Future()
    done.set_result(row_of(cases[0], None, "flown"))
    killed.set_exception(BrokenProcessPool("terminated abruptly"))
    workers = Mock(submit=Mock(side_effect=[done, killed]))
    # Then both have a row
    flown = list(_flown(workers, Namespace(mission=tmp_path, airframe=None), cases, tmp_path))
    assert {row.reason for _, row, _ in flown} == {"flown", "failed: terminated abruptly"}


def test_what_cannot_be_compared_is_one_sentence_before_anything_is_flown(tmp_path):
    for words, said in (
        (("wall", "--laws", "papr"), "must be 'adaptive'"),
        (("hover", "--speeds", "1", "--set", "items.4={return: {speed_m_s: null}}"), "no item of"),
        (("wall", "--airframe", "foldible"), "did you mean foldable?"),
        (("wall", "--out", tmp_path), f"{tmp_path} exists already"),
        (("wall", "--scheduler", "tcp://127.0.0.1:1", "--out", tmp_path / "none"), "no Dask scheduler answers there"),
    ):
        assert_one_clear_sentence(run_here("compare", *words), said)
    assert not any(tmp_path.iterdir())


def test_speeds_are_a_range_or_a_list(capsys):
    assert speeds_m_s("1..4") == [1, 2, 3, 4] and speeds_m_s("1.5..3") == [1.5, 2.5] and speeds_m_s("1,2.5") == [1, 2.5]
    for wrong in ("4..1", "fast", "0,1", "nan", "1..inf", "1..99999999"):
        with pytest.raises(SystemExit):
            main(["compare", "wall", "--speeds", wrong])
        assert f"'{wrong}' is not speeds" in capsys.readouterr().err


def hit(speed_m_s, rest_s):
    truth = {"impact_velocity_ned_m_s": (speed_m_s, 0.0, 0.0), "height_lost_m": 0.1, "stopped_off_m": 0.5}
    return {"settled_after_s": rest_s, "truth": truth}


def row(asked_m_s, collision, outcome="completed", recontacts=0):
    summary = {"outcome": outcome, "reason": "", "recontacts": recontacts, "collisions": [collision]}
    return row_of(Case("paper", asked_m_s, 1, ()), summary)


def test_the_table_has_medians_of_what_is_known_and_the_worst():
    rows = [
        row(2.0, hit(2.0, 1.0), recontacts=1),
        row(2.0, hit(3.0, None), "aborted"),
        row(2.0, {"truth": None}),
        row_of(Case("paper", 2.0, 1, ()), None),
    ]
    _, line = lines_of(rows)
    assert line == ("paper-2-m-s", "2 of 4", "2.50 (3.00)", "1.00 (1.00)", "0.10 (0.10)", "1", "0.50 (0.50)")
