"""`rebound doctor`: one archive for whoever is asked for help, without keys, on request without places."""

import json
import os
import tarfile

import pytest

from rebound_cli.main import main
from rebound_cli.service import doctor
from tests.rebound_cli.flights.flying import pretend

KEY = "0123456789abcdef" * 4
JOURNAL = "      5.000 s  state watching  mode POSCTL  position +47.11 -8.15 -1.50 m, 0.10 m/s  link 90 kB/s"


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A drone with settings, a key beside them, a journal and four flights."""
    settings, tools, runs = tmp_path / "etc", tmp_path / "bin", tmp_path / "runs"
    settings.mkdir()
    tools.mkdir()
    (settings / "guard.yaml").write_text(f"then: hold  # key {KEY}\n")
    (settings / "signing.key").write_text(KEY)
    journalctl = tools / "journalctl"
    journalctl.write_text(f"#!/bin/sh\necho '{JOURNAL}'\necho asked for $*\n")
    journalctl.chmod(0o755)
    for day in (1, 2, 3, 4):
        pretend(runs, f"2026010{day}T000000Z-guard", 100)
    monkeypatch.setattr(doctor, "SETTINGS", settings)
    monkeypatch.setenv("PATH", str(tools), prepend=os.pathsep)
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path / "run"))
    return tmp_path


def archived(machine, *words):
    out = machine / "doctor.tar.gz"
    assert main(["doctor", "--runs", str(machine / "runs"), "--out", str(out), *words]) == 0
    with tarfile.open(out) as tar:
        return {member.name: tar.extractfile(member).read().decode() for member in tar.getmembers()}


def test_the_archive_has_settings_versions_machine_journal_and_the_last_flights_and_no_key(machine, capsys):
    preflight = machine / "found.json"
    preflight.write_text('[{"item": "stream HIGHRES_IMU", "verdict": "good"}]')
    own = machine / "mine.yaml"
    own.write_text("max_hits: 5\n")
    files = archived(machine, "--flights", "2", "--preflight", str(preflight), "--config", str(own))
    assert {"versions.json", "machine.txt", "journal.txt", "status.json", "preflight.json"} < files.keys()
    assert files["settings/1-mine.yaml"] == "max_hits: 5\n"
    assert files["settings/2-guard.yaml"] == "then: hold  # key (key left out)\n"
    assert "px4-rebound" in json.loads(files["versions.json"])
    assert "MB free" in files["machine.txt"]
    assert JOURNAL in files["journal.txt"] and "--unit=rebound*" in files["journal.txt"]
    assert "Nothing answers" in json.loads(files["status.json"])["error"]
    flights = {name.split("/")[1] for name in files if name.startswith("flights/")}
    assert flights == {"20260103T000000Z-guard", "20260104T000000Z-guard"}
    assert KEY not in "".join(files.values()) and not any("signing" in name for name in files)
    assert "2 flights; keys are left out" in capsys.readouterr().out


def test_without_coordinates_the_journal_has_none_and_the_flights_have_no_packets(machine):
    files = archived(machine, "--no-position")
    assert "47.11" not in "".join(files.values()) and "position [left out], 0.10 m/s" in files["journal.txt"]
    assert not any(name.endswith(".tlog") for name in files)
    assert any(name.endswith("events.jsonl") for name in files)


def test_a_machine_without_journal_settings_and_flights_gives_what_it_has(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor, "SETTINGS", tmp_path / "none")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    files = archived(tmp_path)
    assert files["journal.txt"] == "journalctl is not installed here\n"
    assert not any(name.startswith(("flights/", "settings/")) for name in files)


def test_a_file_that_is_named_and_not_there_is_one_sentence(tmp_path, capsys):
    out = tmp_path / "doctor.tar.gz"
    assert main(["doctor", "--config", str(tmp_path / "no.yaml"), "--out", str(out)]) == 1
    assert "no.yaml does not exist" in capsys.readouterr().err
    assert not out.exists()
