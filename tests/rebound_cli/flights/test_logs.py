"""`rebound logs`: what a person sees of the flights on a drone, and takes away."""

import tarfile

import pytest

from rebound_cli.flights import kept
from rebound_cli.main import main
from tests.rebound_cli.flights.flying import pretend, record

LAST = "20260103T000000Z-guard"


@pytest.fixture
def runs(tmp_path):
    runs = tmp_path / "runs"
    pretend(runs, "20260101T000000Z-square", 1_000_000, summary={"outcome": "completed", "reason": "landed"})
    pretend(runs, "20260102T000000Z-guard", 500_000, hits=2)
    folder = runs / LAST
    folder.mkdir()
    record(folder)
    return runs


def logs(*words):
    return main(["logs", *map(str, words)])


def test_list_has_every_flight_from_the_oldest_on_and_how_it_ended(runs, capsys):
    assert logs("list", "--runs", runs) == 0
    first, second, third, total = capsys.readouterr().out.splitlines()
    assert first.startswith("20260101T000000Z-square") and "1.0 MB" in first and first.endswith("landed")
    assert "no hit" in first and "2.5 s" in second and "2 hits" in second and second.endswith("cut off")
    assert third.startswith(LAST)
    assert total.startswith("3 flights, 1.5 MB")


def test_show_is_of_the_last_flight_and_has_its_events_in_order(runs, capsys):
    assert logs("show", "--runs", runs) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"{LAST}: cut off; 0 hits")
    assert told.index("connected") < told.index("a step came late")
    assert logs("show", "20260102T000000Z-guard", "--runs", runs) == 0
    told = capsys.readouterr().out
    assert told.startswith("20260102T000000Z-guard: cut off; 2 hits") and told.count("detection") == 2


def test_without_flights_here_those_of_the_service_are_meant(runs, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(kept, "SERVICE_RUNS", runs)
    assert logs("list") == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("3 flights")
    (tmp_path / "here" / "runs").mkdir()
    assert logs("list") == 0
    assert capsys.readouterr().out.startswith("0 flights")


def test_export_is_one_archive_with_every_byte_of_the_flight(runs, tmp_path, capsys):
    archive = tmp_path / "out.tar.gz"
    assert logs("export", LAST, "--runs", runs, "--out", archive) == 0
    with tarfile.open(archive) as tar:
        files = {member.name: tar.extractfile(member).read() for member in tar.getmembers()}
    assert files == {f"{LAST}/{file.name}": file.read_bytes() for file in (runs / LAST).iterdir()}
    assert str(archive) in capsys.readouterr().out


def test_what_is_not_there_or_cannot_be_written_is_one_sentence(runs, tmp_path, capsys):
    out = tmp_path / "no" / "out.tar.gz"
    for words in (("logs", "show", "yesterday"), ("report", "yesterday"), ("logs", "export", LAST, "--out", out)):
        assert main([*map(str, words), "--runs", str(runs)]) == 1
        assert capsys.readouterr().err.count("\n") == 1
