"""The guard as a service of a real systemd: installed, booted, hit, killed, hung, configured wrongly."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tests.rebound_cli.command import taken_off
from tests.rebound_cli.live.cable import Cable
from tests.rebound_cli.service.sandbox import ROOT, Sandbox

# What the unit hides from the service, such as /tmp and /home, can hold neither the checkout nor its environment.
WHY_NOT = "`make sandbox` boots a systemd, as root, in namespaces of its own; nobody gets that unasked"
pytestmark = [pytest.mark.realtime, pytest.mark.skipif(not os.environ.get("REBOUND_SANDBOX"), reason=WHY_NOT)]


def events(sandbox):
    """Of the newest run."""
    runs = sorted(sandbox.file("/var/lib/rebound/runs").iterdir())
    return [json.loads(line)["kind"] for line in (runs[-1] / "events.jsonl").read_text().splitlines()]


def is_in(sandbox, state):
    return sandbox.shown("SubState") == "running" and sandbox.shown("StatusText").startswith(f"state {state}")


def test_installed_booted_hit_killed_hung_and_configured_wrongly(rebound_vehicle, tmp_path):
    with Sandbox(tmp_path / "sandbox") as sandbox:
        # Given a guard that was installed, and a computer that boots
        sandbox.boot()
        sandbox.install_rebound()
        guard = ("--guard", ROOT / "examples" / "guard.yaml")
        done = sandbox.rebound("service", "install", *guard, "--connect", rebound_vehicle.tcp_address)
        assert done.returncode == 0, done.stderr
        checked = sandbox.rebound("service", "check")
        assert checked.returncode == 0, checked.stdout
        sandbox.boot()
        sandbox.wait_for(lambda: is_in(sandbox, "standing by"))
        policy = sandbox.run("chrt", "--all-tasks", "--pid", sandbox.shown("MainPID")).stdout
        # A kernel may refuse it, as in a container: then that is told.
        first, threads = policy.count("SCHED_FIFO"), policy.count("policy")
        assert threads > 0 and (first == threads or "lost" in events(sandbox)), policy
        assert "MemoryDenyWriteExecute=yes" in sandbox.file("/etc/systemd/system/rebound.service").read_text()
        # When a pilot flies
        pilot = taken_off(rebound_vehicle)
        sandbox.wait_for(lambda: is_in(sandbox, "watching"))
        assert json.loads(sandbox.rebound("status", "--json").stdout)["state"] == "watching"
        # Then a hit is recovered from
        rebound_vehicle.hit(1.5, bearing_deg=90)
        sandbox.wait_for(lambda: "given_back" in events(sandbox))
        # And one that was killed, or hangs, is there again, takes nothing over by itself, and recovers from the next
        for signal, restarts in (("KILL", "1"), ("STOP", "2")):
            assert sandbox.run("systemctl", "kill", "-s", signal, "rebound").returncode == 0
            sandbox.wait_for(lambda restarts=restarts: sandbox.shown("NRestarts") == restarts)
            sandbox.wait_for(lambda: is_in(sandbox, "watching"))
            assert "take_over" not in events(sandbox)
            rebound_vehicle.hit(1.5, bearing_deg=90)
            sandbox.wait_for(lambda: "given_back" in events(sandbox))
        pilot.close()
        # A configuration that is wrong is no reason to start again
        sandbox.file("/etc/rebound/guard.yaml").write_text("max_hits: none\n")
        sandbox.run("systemctl", "restart", "--no-block", "rebound")
        sandbox.wait_for(lambda: sandbox.shown("ExecMainStatus") == "78")
        assert sandbox.shown("ActiveState") == "failed" and sandbox.shown("NRestarts") == "0"


def test_ready_at_the_first_heartbeat_on_the_one_device_that_it_may_open(tmp_path):
    with Cable(tmp_path / "pixhawk") as cable, Sandbox(tmp_path / "sandbox") as sandbox:
        ours = cable.plug()
        shutil.chown(ours, "root", "dialout")
        os.chmod(ours, 0o660)
        # Given a computer that is up before the vehicle is
        sandbox.boot()
        sandbox.install_rebound()
        guard = ("--guard", ROOT / "examples" / "guard.yaml")
        done = sandbox.rebound("service", "install", *guard, "--connect", f"serial://{ours}:921600")
        assert done.returncode == 0, done.stderr
        sandbox.wait_for(lambda: "none heard yet" in sandbox.shown("StatusText"))
        assert sandbox.shown("ActiveState") == "activating"
        # When the vehicle starts
        simulator = [sys.executable, "-m", "rebound_cli", "sim", "--port", "0", "--remote", "127.0.0.1:9"]
        link = ["--link", cable.vehicle_url, "--stop-with-stdin"]
        vehicle = subprocess.Popen([*simulator, *link], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
        try:
            # Then the service is ready, and sees it over that device alone: no network, no other
            sandbox.wait_for(lambda: is_in(sandbox, "standing by"))
        finally:
            vehicle.stdin.close()
            vehicle.wait(20)
        assert sandbox.shown("PrivateNetwork") == "yes"
        # Its clock is ProtectClock's, to be read.
        assert sandbox.shown("DeviceAllow").splitlines() == ["char-rtc r", f"{ours} rw"]
        assert sandbox.shown("NRestarts") == "0"
        # And a vehicle that has gone is waited for
        sandbox.wait_for(lambda: "link silent for" in sandbox.shown("StatusText"))
        assert sandbox.shown("SubState") == "running"
