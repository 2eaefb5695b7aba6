"""A flight of a real ArduPilot in lockstep, where its SITL is in the PATH, and what is said where there is none."""

import json
import shutil
import signal
import subprocess

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.json.parameters import as_parameter_file
from tests.rebound_cli.command import WALL, run_here, start

SITL = shutil.which("arducopter")
# Far from the ports of a SITL that may be running on this machine.
INSTANCE = 9


@pytest.mark.realtime
@pytest.mark.skipif(SITL is None, reason="there is no arducopter, ArduPilot's SITL, in the PATH")
def test_the_wall_is_flown_by_the_real_firmware(tmp_path):
    defaults, folder = tmp_path / "rigid.parm", tmp_path / "run"
    defaults.write_text(as_parameter_file(load_built_in("foldable")))
    options = ("--model", "JSON:127.0.0.1", "-I", str(INSTANCE), "--speedup", "100", "--defaults", str(defaults), "-w")
    with subprocess.Popen([SITL, *options], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as sitl:
        result = run_here("fly", WALL, "--sim", "ardupilot", "--instance", INSTANCE, "--out", folder)
        sitl.kill()
    summary = json.loads((folder / "summary.json").read_text())
    (hit,) = summary["collisions"]
    assert result.returncode == 0 and summary["autopilot"].startswith("ArduPilot")
    assert summary["false_detections"] == summary["missed_contacts"] == 0
    assert hit["truth"]["detection_latency_ms"] <= 30.0 and hit["truth"]["height_lost_m"] <= 0.2


@pytest.mark.realtime
def test_ctrl_c_while_waiting_for_ardupilot_ends_in_a_sentence(tmp_path):
    process = start("fly", WALL, "--sim", "ardupilot", "--instance", INSTANCE, "--out", tmp_path / "run")
    assert any("TCP port 5850 (docs/how-to/ardupilot.md)" in line for line in process.stdout)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 1 and "stopped before ArduPilot's SITL was there" in said


def test_parameters_for_ardupilot_have_no_other_form(tmp_path):
    printed = run_here("airframe", "ardupilot", "--airframe", "rigid")
    assert printed.returncode == 0 and "FRAME_TYPE 1\n" in printed.stdout
    refused = run_here("airframe", "ardupilot", "--format", "env")
    assert refused.returncode != 0 and "--format and --position belong to px4" in refused.stderr
