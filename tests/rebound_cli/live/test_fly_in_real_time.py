"""Flights with the simulated vehicle as a process of its own, and every way they can end."""

import json
import os
import signal
import time
import tomllib

import pytest

from tests.rebound_cli.command import (
    HOP,
    QUICK,
    ROOT,
    SQUARE,
    WALL,
    assert_comes_again,
    processes_naming,
    run_here,
    start,
    wait_for_event,
    wait_until_gone,
)

pytestmark = pytest.mark.realtime


def test_a_short_flight_beside_the_simulated_vehicle(tmp_path):
    # Given two flights at the same time
    folders = [tmp_path / "one", tmp_path / "two"]
    processes = [start("fly", SQUARE, "--sim", *HOP, "--json", "--out", folder) for folder in folders]
    for process, folder in zip(processes, folders, strict=True):
        stdout, stderr = process.communicate(timeout=60)
        # Then neither disturbs the other, and stdout holds the summary and nothing else
        assert process.returncode == 0, stderr
        summary = json.loads(stdout)
        assert summary == json.loads((folder / "summary.json").read_text())
        assert summary["outcome"] == "completed" and summary["collisions"] == []
        assert (summary["false_detections"], summary["missed_contacts"]) == (0, 0)
        assert 0.9 < summary["realtime_factor"] < 1.1
        assert (folder / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
        assert (folder / "truth.npz").exists()
        wait_until_gone(folder)
        # And each can be decided again
        assert_comes_again(folder)


def test_a_second_ctrl_c_ends_at_once(tmp_path):
    # Given a vehicle that has stopped answering, so that the first Ctrl-C has to wait
    folder = tmp_path / "run"
    process = start("fly", WALL, "--sim", *QUICK, "--set", "companion.link.silence_s=60", "--out", folder)
    wait_for_event(folder, "armed")
    (vehicle,) = set(processes_naming(folder)) - {process.pid}
    os.kill(vehicle, signal.SIGSTOP)
    process.send_signal(signal.SIGINT)
    time.sleep(0.5)
    assert process.poll() is None
    # When the person presses it again
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=5)
    # Then the program ends at once, and says what that means
    assert process.returncode == 130
    assert len(stderr.strip().splitlines()) == 1 and "ended at once" in stderr
    wait_until_gone(folder)


def test_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    result = run_here("--version")
    assert (result.returncode, result.stdout) == (0, f"rebound {version}\n")
