"""`--connect`: the person says yes to the plan, and ends the flight."""

import json
import signal
import subprocess

import pytest

from tests.rebound_cli.command import HOP, SQUARE, assert_comes_again, run_here, start, vehicle_on_air, wait_for_event

pytestmark = pytest.mark.realtime


def test_a_yes_flies_the_plan_of_a_vehicle_without_truth_and_ctrl_c_ends_it(tmp_path):
    # Given a vehicle and a companion with one key
    folder, key = tmp_path / "run", tmp_path / "key"
    assert run_here("key", "new", key).returncode == 0
    with vehicle_on_air("--signing-key", key) as port:
        words = ("fly", SQUARE, *HOP, "--connect", f"udpin://127.0.0.1:{port}", "--signing-key", key)
        process = start(*words, "--json", "--out", folder, stdin=subprocess.PIPE)
        wait_for_event(folder, "plan")
        process.stdin.write("y\n")
        process.stdin.flush()
        wait_for_event(folder, "armed")
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=20)
    assert process.returncode == 1 and "Fly this plan?" in stderr
    summary = json.loads(stdout)
    unknown = ("airframe", "seed", "false_detections", "missed_contacts", "recontacts")
    assert [summary[key] for key in unknown] == [None] * 5
    assert summary["outcome"] == "aborted" and "Ctrl-C" in summary["reason"]
    assert set(summary["refused_packets"]) <= {"old"}
    assert not (folder / "truth.npz").exists()
    # And no file of the flight holds the key
    assert not [file for file in folder.iterdir() if key.read_text().strip().encode() in file.read_bytes()]
    assert_comes_again(folder)
