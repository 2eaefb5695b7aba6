"""Where a flight's folder cannot be made, that is said before anything is waited for."""

import os

import pytest

from rebound_cli import fly
from rebound_cli.main import main
from rebound_cli.results.run_folder import TLOG_NAME, RunFolderError, check_place
from tests.rebound_cli.command import WALL


@pytest.fixture
def nothing_compiles(monkeypatch):
    def compiled(*_):
        raise AssertionError("minutes of compiling for a flight that cannot be kept")

    monkeypatch.setattr(fly, "prepare_vehicle", compiled)


COMMANDS = [("fly", str(WALL), "--lockstep"), ("guard", "--connect", "udpin://127.0.0.1:0")]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_folder_below_a_file_or_with_a_flight_is_refused_at_once(command, tmp_path, capsys, nothing_compiles):
    (tmp_path / TLOG_NAME).write_bytes(b"")
    assert main([*command, "--out", str(tmp_path / TLOG_NAME / "run")]) == 1
    assert f"run cannot be made: nothing can be written to {tmp_path / TLOG_NAME}." in capsys.readouterr().err
    assert main([*command, "--out", str(tmp_path)]) == 1
    assert "already holds a flight" in capsys.readouterr().err


def test_a_folder_that_nobody_may_write_to_is_refused(tmp_path, monkeypatch):
    # Root may write everywhere.
    monkeypatch.setattr(os, "access", lambda place, _: place != tmp_path)
    with pytest.raises(RunFolderError, match=f"nothing can be written to {tmp_path}"):
        check_place(tmp_path / "run")
