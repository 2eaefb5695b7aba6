"""The campaign engine: who computes, in what order and how often it was broken off changes nothing."""

import json
import os
import random
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import dask
import pytest

from bench.fly import campaign as running
from bench.fly.campaign import Campaign, CampaignError, Workers, run_campaign, work_out
from tests.rebound_cli.command import ROOT

pytestmark = pytest.mark.slow

SCRIPT = """\
import sys
from pathlib import Path
from tests.bench.test_campaign import campaign, table, throw_and_die_once
from distributed import LocalCluster
from bench.fly.campaign import Workers, run_campaign
if __name__ == "__main__":
    who, folder = sys.argv[1], Path(sys.argv[2])
    if who == "killed":
        print(table(run_campaign(campaign(work_out=throw_and_die_once, die=str(folder / "died")), Workers(2), folder)))
    elif who == "scheduler":
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=':0') as cluster:
            print(table(run_campaign(campaign(), Workers(scheduler=cluster.scheduler_address), folder)))
    else:
        print(table(run_campaign(campaign(), Workers(int(who)), folder)))
"""


@dataclass(frozen=True)
class Throw:
    """A case that knows its seed; the unlucky ones fail."""

    seed: int
    fails: bool = False
    die: str = ""


def throw(case):
    if case.fails:
        raise ValueError(f"nothing falls upwards, seed {case.seed}")
    return {"height_m": random.Random(case.seed).random(), "seed": case.seed}


def throw_and_die_once(case):
    """The same, but the tenth takes its worker with it the first time. No worker may grow by a profile of itself."""
    assert case.seed == 1000 or not dask.config.get("distributed.worker.profile.enabled")
    if case.seed == 1010 and not os.path.exists(case.die):
        Path(case.die).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return throw(case)


def campaign(cases=30, work_out=throw, die="", **parameters):
    throws = [Throw(1000 + number, fails=number in (4, 17), die=die) for number in range(cases)]
    return Campaign("throws", {"cases": cases, **parameters}, throws, work_out)


def table(results):
    return json.dumps([results.results, results.failures])


def test_one_two_or_a_schedulers_workers_give_the_same_bytes(tmp_path):
    # Given the same campaign in folders of its own
    texts = []
    for who in ("1", "2", "killed", "scheduler"):
        # When one process works it out, or two, or two of which one is killed, or those of a scheduler that was there
        command = [sys.executable, "-c", SCRIPT, who, str(tmp_path / who)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True, timeout=300)
        texts.append(done.stdout)
    # Then the results are the same to the byte, with the failures among them
    assert len(set(texts)) == 1 and (tmp_path / "killed" / "died").exists()
    results, failures = json.loads(texts[0])
    assert len(results) == 28 and set(failures) == {"4", "17"}


def test_a_failing_case_is_listed_with_its_seed_and_cause_and_stops_nothing(tmp_path):
    results = run_campaign(campaign(), Workers(), tmp_path)
    assert set(results.failures) == {4, 17} and set(results.results) == set(range(30)) - {4, 17}
    text = results.text(campaign())
    assert "case 4 failed: ValueError: nothing falls upwards" in text and "seed=1004" in text


@pytest.mark.parametrize("torn", ["", '{"case":9,"resu'])
def test_a_broken_off_campaign_goes_on_and_ends_as_an_unbroken_one(tmp_path, monkeypatch, torn):
    # Given a run that ends after ten cases, perhaps in the middle of a line
    whole = table(run_campaign(campaign(), Workers(), tmp_path / "whole"))
    (path,) = (tmp_path / "whole").iterdir()
    (tmp_path / "broken").mkdir()
    begun = "".join(path.read_text().splitlines(keepends=True)[:11]) + torn
    (tmp_path / "broken" / path.name).write_text(begun)
    # When the same campaign is run again
    again = []

    def outcomes(function, missing, workers):
        again.extend(number for number, _ in missing)
        yield from work_out(function, missing)

    monkeypatch.setattr(running, "outcomes", outcomes)
    resumed = table(run_campaign(campaign(), Workers(), tmp_path / "broken"))
    # Then only what was missing or had failed is worked out, and the results are the same
    assert again == [4, *range(10, 30)]
    assert resumed == whole


def test_other_parameters_are_another_campaign(tmp_path):
    assert campaign(30).record_path() == campaign(30).record_path()
    assert len({one.record_path() for one in (campaign(30), campaign(31), campaign(30, hits=5))}) == 3


@pytest.mark.parametrize("line", [b"nonsense", b"\xff", b"3", b'{"result":1}', b'{"case":[]}'])
def test_a_damaged_record_is_refused_with_the_line(tmp_path, line):
    run_campaign(campaign(0), Workers(), tmp_path)
    with campaign(0).record_path(tmp_path).open("ab") as file:
        file.write(line + b"\n")
    with pytest.raises(CampaignError, match=r"is damaged in line 2; move it away\.$"):
        run_campaign(campaign(0), Workers(), tmp_path)


def test_a_scheduler_that_is_not_there_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(CampaignError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run_campaign(campaign(), Workers(scheduler="tcp://127.0.0.1:9"), tmp_path)
