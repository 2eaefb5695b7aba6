"""Where a flight's folder cannot be made, that is said before anything is waited for."""

import os
import subprocess
import sys

import pytest

from rebound_cli import fly
from rebound_cli.main import main
from rebound_cli.results.run_folder import TLOG_NAME, check_place
from tests.rebound_cli.command import ROOT, WALL


@pytest.fixture
def nothing_compiles(monkeypatch):
    def compiled(*_):
        raise AssertionError("minutes of compiling for a flight that cannot be kept")

    monkeypatch.setattr(fly, "prepare_vehicle", compiled)


COMMANDS = [("fly", str(WALL), "--lockstep"), ("guard", "--connect", "udpin://127.0.0.1:0")]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_folder_below_a_file_is_refused_at_once(command, tmp_path, capsys, nothing_compiles):
    (tmp_path / "file").write_text("")
    assert main([*command, "--out", str(tmp_path / "file" / "run")]) == 1
    assert f"run cannot be made: nothing can be written to {tmp_path / 'file'}." in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_folder_that_holds_a_flight_is_refused_at_once(command, tmp_path, capsys, nothing_compiles):
    (tmp_path / TLOG_NAME).write_bytes(b"")
    assert main([*command, "--out", str(tmp_path)]) == 1
    assert "already holds a flight" in capsys.readouterr().err


def test_a_folder_is_looked_for_above_the_ones_to_be_made(tmp_path):
    check_place(tmp_path / "a" / "b")
    assert not any(tmp_path.iterdir())


def test_a_folder_that_nobody_may_write_to_is_refused(tmp_path):
    tmp_path.chmod(0o555)
    # Root may write everywhere: it becomes nobody, once all is imported.
    code = f"""
import os
from pathlib import Path
from rebound_cli.results.run_folder import RunFolderError, check_place
os.chdir({str(tmp_path)!r})
if os.geteuid() == 0:
    os.setresuid(65534, 65534, 65534)
try:
    check_place(None)
except RunFolderError as error:
    print(error)
"""
    os.chmod(tmp_path.parent, 0o755)
    os.chmod(tmp_path.parent.parent, 0o755)
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == f"The run folder runs cannot be made: nothing can be written to {tmp_path}.\n", done.stderr
