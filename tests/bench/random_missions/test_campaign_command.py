"""`python -m bench campaign` from end to end, small; and its verdicts on made-up results."""

import json

import pytest

from bench.cases.missions import MissionCase
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Results
from bench.main import main
from bench.rows.tables import MET, MISSED, REPORTED
from bench.studies import study
from bench.studies.campaign import MISSIONS_WANTED, failures_table, hit_rows, mission_bars, mission_rows

pytestmark = pytest.mark.slow

# A short mission in which a pole is hit.
SEED = "4"
HIT = {"kind": "wall", "speed_m_s": 2.0, "closing_m_s": 2.0, "climbing_m_s": 0.0, "steepness": 0.0, "seen": True}
HIT |= {"again": 0, "returned": 0, "others": 0, "settled_s": 1.4, "past_m": 0.01, "lost_m": 0.02}


def made_up(count=200, failing=(), **changes):
    """So many missions with a hit each; those of `failing` fail, the first hit of each airframe is changed."""
    found = []
    for case in (MissionCase(seed, name) for seed in range(1, count + 1) for name in AIRFRAMES):
        result = {
            "room": "corner",
            "stream_hz": 50,
            "wind_m_s": 3.0,
            "extras": [],
            "failures": [["fell", "at 3.00 s"]] if case.seed in failing else [],
            "hits": [{**HIT, **changes} if case.seed == 1 else dict(HIT)],
        }
        found.append((case, result))
    return Results(found)


def bars_of(flown):
    return mission_bars(mission_rows(flown), hit_rows(flown), MISSIONS_WANTED)


def verdicts(bars, word):
    return [bar["verdict"] for bar in bars if word in bar["what"]]


def test_perfect_missions_meet_every_bar():
    assert {*verdicts(bars_of(made_up()), "")} == {MET, REPORTED}


@pytest.mark.parametrize("changes", [{"past_m": 0.06}, {"again": 1}])
def test_one_hit_in_fifty_that_overshoots_or_touches_again_is_too_many(changes):
    assert verdicts(bars_of(made_up(count=50, **changes)), "overshoot")[0] == MISSED
    assert verdicts(bars_of(made_up(count=100, **changes)), "overshoot")[0] == MET


def test_one_hit_that_loses_too_much_height_is_enough_if_it_was_on_something_upright():
    assert verdicts(bars_of(made_up(lost_m=0.11)), "height lost") == [MISSED, MISSED]
    assert verdicts(bars_of(made_up(lost_m=0.11, steepness=0.8)), "height lost") == [MET, MET]


def test_every_failure_is_listed_with_its_cause_and_the_command_to_see_it_again():
    rows = failures_table(mission_rows(made_up(failing=[17]))).splitlines()
    assert "fell: at 3.00 s" in rows[2] and rows[2].rstrip(" |").endswith("`python -m bench campaign --only 17`")
    assert rows[-1].rstrip(" |").endswith("`python -m bench campaign --only 17 --airframe rigid`")


def test_the_command_writes_a_page_its_rows_and_a_record_and_flies_a_mission_again_with_its_whole_folder(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    words = ["--missions", "1", "--first-seed", SEED, "--jobs", "1", "--out", str(tmp_path / "docs")]
    assert main(["campaign", *words]) == 0
    text = (tmp_path / "docs" / "campaign.md").read_text()
    assert "foldable: missions that end as they say, without a crash" in text
    assert f"`python -m bench campaign --missions 1 --first-seed {SEED} --jobs 1" in text
    flights = [json.loads(line) for line in (tmp_path / "docs" / "campaign.jsonl").read_text().splitlines()]
    assert [(flight["seed"], flight["airframe"]) for flight in flights] == [(4, "foldable"), (4, "rigid")]
    (record,) = (tmp_path / "runs").rglob("campaign-*.jsonl")
    _, rigid = record.read_text().splitlines()
    result = json.loads(rigid)["result"]
    # And one again is the same flight
    code = main(["campaign", "--only", SEED, "--airframe", "rigid", "--out", str(tmp_path / "again")])
    assert code == (1 if result["failures"] else 0)
    assert ("It ended as it says." in capsys.readouterr().out) is (not result["failures"])
    summary = json.loads((tmp_path / "again" / "summary.json").read_text())
    assert summary["duration_s"] == result["seconds"] and summary["airframe"] == "rigid"
    assert summary["outcome"] == result["outcome"] and len(summary["collisions"]) > 0
    assert (tmp_path / "again" / "report.html").exists()


def test_what_cannot_be_written_is_said_before_anything_is_flown(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "run_campaign", lambda *_: pytest.fail("flown"))
    (tmp_path / "docs").write_text("a file")
    assert main(["campaign", "--missions", "1", "--out", str(tmp_path / "docs")]) == 1
    assert "cannot be made" in capsys.readouterr().err


def test_an_airframe_of_ones_own_is_looked_over_as_for_a_flight_and_flown_alone(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "own.yaml"
    # Given one that would begin in the ground
    own.write_text("based_on: rigid\ngeometry: {foot_depth_m: 0.04}\n")
    assert main(["campaign", "--airframe", str(own), "--missions", "1"]) == 1
    assert f"{own}:1: the hub, geometry.hub_solid_radius_m, reaches" in capsys.readouterr().err
    # When it is mended
    own.write_text("based_on: racer\nname: own\nmass_kg: 0.8\n")
    words = ["--missions", "1", "--first-seed", SEED, "--jobs", "1", "--out", str(tmp_path / "page")]
    assert main(["campaign", "--airframe", str(own), *words]) == 0
    # Then it alone flew, and its rows are kept by what is in the file
    (flight,) = (tmp_path / "page" / "campaign.jsonl").read_text().splitlines()
    assert json.loads(flight)["airframe"] == str(own)
    assert [path.name for path in (tmp_path / "runs").rglob("campaign-own-*.jsonl")]
