"""The campaign engine: who computes, in what order and how often it was broken off changes nothing."""

import json
import os
import random
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest

from bench.fly import campaign as running
from bench.fly.campaign import CampaignError, run_campaign


@dataclass(frozen=True)
class Throw:
    """A case that knows its seed; the unlucky ones fail."""

    seed: int
    fails: bool = False
    die: str = ""


def throw(case):
    if case.fails:
        raise ValueError(f"nothing falls upwards, seed {case.seed}")
    return {"height_m": random.Random(case.seed).random()}


def throw_and_die_once(case):
    """The same, but the tenth takes its worker with it the first time."""
    if case.seed == 1010 and not os.path.exists(case.die):
        Path(case.die).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return throw(case)


def campaign(folder, work_out=throw, jobs=1, cases=30):
    die = str(folder / "died") if work_out is throw_and_die_once else ""
    throws = [Throw(1000 + number, fails=number in (4, 17), die=die) for number in range(cases)]
    return run_campaign("throws", throws, work_out, jobs, folder)


def table(results):
    return json.dumps([[case.seed, result] for case, result in results.found]), len(results.failures)


@pytest.mark.slow
def test_one_worker_two_or_one_that_is_killed_give_the_same_results(tmp_path):
    # Given the same campaign in folders of its own, worked out by one process, by two, and by two of which one dies
    one, two = (table(campaign(tmp_path / str(jobs), jobs=jobs)) for jobs in (1, 2))
    killed = tmp_path / "killed", throw_and_die_once, 2
    # Then a worker's death is a sentence, and the same command goes on from there
    with pytest.raises(CampaignError, match="A worker died; the same command goes on from there"):
        campaign(*killed)
    assert (tmp_path / "killed" / "died").exists()
    # and the results are the same, with the failures among them
    assert one == two == table(campaign(*killed))


def test_a_failing_case_is_listed_with_its_seed_and_cause_and_stops_nothing(tmp_path):
    results = campaign(tmp_path)
    assert [case.seed - 1000 for case, _ in results.found] == [n for n in range(30) if n not in (4, 17)]
    assert "throws: ValueError: nothing falls upwards" in results.failures[0] and "seed=1004" in results.failures[0]


@pytest.mark.parametrize("torn", ["", '{"case":9,"resu'])
def test_a_broken_off_campaign_goes_on_and_ends_as_an_unbroken_one(tmp_path, monkeypatch, torn):
    # Given a run that ends after ten cases, perhaps in the middle of a line
    whole = table(campaign(tmp_path / "whole"))
    (path,) = (tmp_path / "whole").iterdir()
    (tmp_path / "broken").mkdir()
    begun = "".join(path.read_text().splitlines(keepends=True)[:10]) + torn
    (tmp_path / "broken" / path.name).write_text(begun)
    # When the same campaign is run again
    again, worked_out = [], running.worked_out

    def noted(work_out, missing, jobs):
        again.extend(case.seed - 1000 for case in missing)
        yield from worked_out(work_out, missing, jobs)

    monkeypatch.setattr(running, "worked_out", noted)
    resumed = table(campaign(tmp_path / "broken"))
    # Then only what was missing or had failed is worked out, and the results are the same
    assert again == [4, *range(10, 30)]
    assert resumed == whole
