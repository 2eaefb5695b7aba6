"""Flights as processes of their own: beside the simulated vehicle, `--connect`, PX4 or ArduPilot; how they can end."""

import json
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
import tomllib

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.json.parameters import as_parameter_file
from tests.clients.simulator import free_port, simulator
from tests.rebound_cli import command
from tests.rebound_cli.command import SQUARE, WALL, assert_comes_again, run_here, start, wait_for_event
from tests.sim_vehicle.hil.test_hil_tcp import Px4Client

pytestmark = pytest.mark.realtime


def test_a_short_flight_beside_the_simulated_vehicle(tmp_path):
    # Given two flights at the same time
    folders = [tmp_path / "one", tmp_path / "two"]
    processes = [start("fly", SQUARE, "--sim", *command.HOP, "--json", "--out", folder) for folder in folders]
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
        command.wait_until_there(folder, False)
        # And each can be decided again
        assert_comes_again(folder)


def test_what_is_known_of_a_flight_is_told_where_its_simulated_vehicle_is_killed(tmp_path):
    folder = tmp_path / "run"
    process = start("fly", WALL, "--sim", *command.QUICK, "--json", "--out", folder)
    wait_for_event(folder, "armed")
    (vehicle,) = set(command.processes_naming(folder)) - {process.pid}
    os.kill(vehicle, signal.SIGKILL)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 1 and stderr.endswith("ended by itself: killed by signal 9\n")
    summary = json.loads(stdout)
    assert summary == json.loads((folder / "summary.json").read_text())
    assert (summary["outcome"], summary["missed_contacts"]) == ("failed", None)
    assert "killed by signal 9" in summary["reason"] and (folder / "report.html").exists()


def test_a_second_ctrl_c_ends_at_once(tmp_path):
    # Given a vehicle that has stopped answering, so that the first Ctrl-C has to wait
    folder = tmp_path / "run"
    process = start("fly", WALL, "--sim", *command.QUICK, "--set", "companion.link.silence_s=60", "--out", folder)
    wait_for_event(folder, "armed")
    (vehicle,) = set(command.processes_naming(folder)) - {process.pid}
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
    command.wait_until_there(folder, False)


def test_version():
    version = tomllib.loads((command.ROOT / "pyproject.toml").read_text())["project"]["version"]
    result = run_here("--version")
    assert (result.returncode, result.stdout) == (0, f"rebound {version}\n")


def test_a_yes_flies_the_plan_of_a_vehicle_without_truth_and_ctrl_c_ends_it(tmp_path):
    # Given a vehicle and a companion with one key
    folder, key = tmp_path / "run", tmp_path / "key"
    assert run_here("key", "new", key).returncode == 0
    with simulator("--signing-key", key) as vehicle:
        words = ("fly", SQUARE, *command.HOP, "--connect", f"udpin://127.0.0.1:{vehicle.companion_port}")
        process = start(*words, "--signing-key", key, "--json", "--out", folder, stdin=subprocess.PIPE)
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


# Far from the ports of a PX4 that may be running on this machine.
INSTANCE = 9
SIMULATOR_PORT = 4560 + INSTANCE


def next_line_with(process, words):
    for line in process.stdout:
        if words in line:
            return line
    raise AssertionError(f"it ended without saying {words!r}")


def test_the_body_alone_serves_a_px4_and_writes_the_truth(tmp_path):
    port, path = SIMULATOR_PORT, tmp_path / "truth.npz"
    options = ("--instance", INSTANCE, "--mission", WALL, "--speed", "0", "--truth", path)
    process = start("sim", "--autopilot", "px4", *options)
    next_line_with(process, f"TCP port {port}")
    px4 = Px4Client(port)
    assert [px4.next_step()[-1].time_usec for _ in range(3)] == [1_000, 2_000, 3_000]
    px4.answer([0.0] * 4)
    next_line_with(process, "PX4 answers")
    px4.close()
    next_line_with(process, "flight ends")
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 0
    assert path.exists()


def test_ctrl_c_while_waiting_for_px4_ends_everything(tmp_path):
    folder = tmp_path / "run"
    process = start("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--out", folder)
    assert str(SIMULATOR_PORT) in next_line_with(process, "Waiting for PX4")
    command.wait_until_there(folder / "resolved.yaml")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 1
    command.wait_until_there(folder, False)
    # And the folder can be flown to again
    assert not folder.exists()


@pytest.mark.parametrize(
    ("kind", "port"), [(socket.SOCK_DGRAM, 14540 + INSTANCE), (socket.SOCK_STREAM, SIMULATOR_PORT)]
)
def test_a_port_that_is_taken_is_one_sentence(tmp_path, kind, port):
    with socket.socket(socket.AF_INET, kind) as other:
        other.bind(("0.0.0.0", port))
        if kind == socket.SOCK_STREAM:
            other.listen(1)
        result = run_here("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--out", tmp_path / "run")
    sentence = result.stderr.strip().splitlines()[-1]
    assert result.returncode == 1 and sentence.startswith("rebound: ") and str(port) in sentence
    # Tried before anything is written
    assert kind == socket.SOCK_STREAM or not (tmp_path / "run").exists()


SITL = shutil.which("arducopter")


@pytest.mark.skipif(SITL is None, reason="there is no arducopter, ArduPilot's SITL, in the PATH")
def test_the_wall_is_flown_by_the_real_firmware(tmp_path):
    defaults, folder = tmp_path / "foldable.parm", tmp_path / "run"
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


def test_ctrl_c_while_waiting_for_ardupilot_ends_in_a_sentence(tmp_path):
    process = start("fly", WALL, "--sim", "ardupilot", "--instance", INSTANCE, "--out", tmp_path / "run")
    assert any("TCP port 5850 (docs/how-to/ardupilot.md)" in line for line in process.stdout)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 1 and "stopped before ArduPilot's SITL was there" in said
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("words", [("fly", SQUARE, "--yes"), ("guard",)], ids=lambda words: words[0])
def test_a_vehicle_whose_packets_are_all_refused_is_told_from_one_that_is_not_there(tmp_path, words):
    # Given one that does not sign, and a companion with a key
    key, port, is_over = tmp_path / "key", free_port(), threading.Event()
    assert run_here("key", "new", key).returncode == 0
    packet = dialect.MAVLink_heartbeat_message(2, 12, 0x51, 0x30000, 3, 3).pack(dialect.MAVLink(None, 1, 1))

    def vehicle():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            while not is_over.wait(0.05):
                end.sendto(packet, ("127.0.0.1", port))

    thread = threading.Thread(target=vehicle)
    thread.start()
    link = ("--connect", f"udpin://127.0.0.1:{port}", "--signing-key", key)
    quick = ("--set", "companion.link.heartbeat_wait_s=0.5", "--out", tmp_path / "run")
    done = run_here(*words, *link, *quick)
    is_over.set()
    thread.join()
    assert done.returncode == 1 and "packets were refused: do both ends sign" in done.stdout + done.stderr
