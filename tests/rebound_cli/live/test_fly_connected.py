"""`--connect`: nothing arms before the person has said yes, and the link is kept alive meanwhile."""

import contextlib
import itertools
import json
import signal
import subprocess
import time

import pytest

from companion.shell.tlog import read_tlog
from tests.rebound_cli.command import (
    HOP,
    SQUARE,
    assert_comes_again,
    events_of,
    run,
    start,
    vehicle_on_air,
    wait_for_event,
)

pytestmark = pytest.mark.realtime

COMPANION = 191
HEARTBEAT, SET_POSITION_TARGET, COMMAND_LONG = 0, 84, 76


@contextlib.contextmanager
def flown(folder, *options, key=None):
    """Beside a vehicle on the air; both sign where there is a key."""
    signing = () if key is None else ("--signing-key", key)
    with vehicle_on_air(*signing) as port:
        address = f"udpin://127.0.0.1:{port}"
        words = ("fly", SQUARE, "--connect", address, "--out", folder, *HOP, *signing, *options)
        yield start(*words, stdin=subprocess.PIPE)


def sent_by_companion(folder, message_id):
    """Times in seconds and packets."""
    return [
        (at_us / 1e6, packet)
        for at_us, packet in read_tlog(folder / "flight.tlog")
        if packet[6] == COMPANION and packet[7] | packet[8] << 8 | packet[9] << 16 == message_id
    ]


def test_without_a_yes_nothing_is_armed(tmp_path):
    # Given a vehicle that is ready and a person who takes their time
    folder = tmp_path / "run"
    with flown(folder) as process:
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


def test_a_yes_flies_the_plan_of_a_vehicle_without_truth_and_ctrl_c_ends_it(tmp_path):
    # Given a vehicle and a companion with one key
    folder, key = tmp_path / "run", tmp_path / "key"
    assert run("key", "new", key).returncode == 0
    with flown(folder, "--json", key=key) as process:
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
    assert summary["outcome"] == "aborted" and set(summary["refused_packets"]) <= {"old"}
    assert not (folder / "truth.npz").exists()
    assert_comes_again(folder)
