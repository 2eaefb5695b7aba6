"""`--connect`: nothing arms before the person has said yes, and the link is kept alive meanwhile."""

import itertools
import json
import signal
import subprocess
import time

import pytest

from companion.shell.tlog import read_tlog
from tests.rebound_cli.command import HOP, SQUARE, assert_comes_again, events_of, start, vehicle_on_air, wait_for_event

pytestmark = pytest.mark.realtime

COMPANION = 191
HEARTBEAT, SET_POSITION_TARGET, COMMAND_LONG = 0, 84, 76


@pytest.fixture
def address():
    """A vehicle on the air and the address at which it expects its companion."""
    with vehicle_on_air() as port:
        yield f"udpin://127.0.0.1:{port}"


def fly(address, folder, *options, stdin=subprocess.DEVNULL):
    return start("fly", SQUARE, "--connect", address, "--out", folder, *HOP, *options, stdin=stdin)


def sent_by_companion(folder, message_id):
    """Times in seconds and packets."""
    return [
        (at_us / 1e6, packet)
        for at_us, packet in read_tlog(folder / "flight.tlog")
        if packet[6] == COMPANION and packet[7] | packet[8] << 8 | packet[9] << 16 == message_id
    ]


def test_without_a_yes_nothing_is_armed(address, tmp_path):
    # Given a vehicle that is ready and a person who takes their time
    folder = tmp_path / "run"
    process = fly(address, folder, stdin=subprocess.PIPE)
    wait_for_event(folder, "plan")
    time.sleep(1.5)
    # When the person does not say yes
    stdout, _ = process.communicate("later\n", timeout=20)
    # Then the flight ends there, with the plan shown, no setpoint sent, and heartbeats all the while
    assert process.returncode == 1
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["outcome"] == "aborted" and "not confirmed" in summary["reason"]
    assert "Fly this plan? [y/N]" in stdout and "fence" in stdout.lower()
    assert not any(event["kind"] == "armed" for event in events_of(folder))
    assert sent_by_companion(folder, SET_POSITION_TARGET) == []
    heartbeats_s = [at_s for at_s, _ in sent_by_companion(folder, HEARTBEAT)]
    assert max(b - a for a, b in itertools.pairwise(heartbeats_s)) < 1.5
    assert_comes_again(folder)


def assert_flying_until_stopped(process, folder):
    """It arms; then Ctrl-C ends it in good order. Returns stdout and stderr."""
    wait_for_event(folder, "armed")
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=20)
    assert process.returncode == 1
    assert json.loads((folder / "summary.json").read_text())["outcome"] == "aborted"
    return stdout, stderr


def test_a_yes_flies_the_plan_of_a_vehicle_without_truth(address, tmp_path):
    folder = tmp_path / "run"
    process = fly(address, folder, "--json", stdin=subprocess.PIPE)
    wait_for_event(folder, "plan")
    process.stdin.write("y\n")
    process.stdin.flush()
    stdout, stderr = assert_flying_until_stopped(process, folder)
    summary = json.loads(stdout)
    unknown = ("airframe", "seed", "false_detections", "missed_contacts", "recontacts")
    assert [summary[key] for key in unknown] == [None] * 5
    assert "Fly this plan?" in stderr
    assert not (folder / "truth.npz").exists()
    assert_comes_again(folder)


def test_yes_on_the_command_line_shows_the_plan_and_does_not_ask(address, tmp_path):
    process = fly(address, tmp_path / "run", "--yes")
    stdout, _ = assert_flying_until_stopped(process, tmp_path / "run")
    assert "fence" in stdout.lower() and "Fly this plan?" not in stdout
