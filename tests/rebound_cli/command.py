"""Runs the command as a person does: in a process of its own, or in this one, which has its libraries loaded."""

import contextlib
import io
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
from pymavlink import mavutil

from rebound_cli.main import main
from rebound_cli.replay.recording import read_recording, reproduce
from tests.clients.simulator import wait_until

ROOT = Path(__file__).parents[2]
WALL = ROOT / "missions" / "wall.yaml"
SQUARE = ROOT / "missions" / "square.yaml"

# Measure the streams for half a second instead of two: real time is dear in tests.
QUICK = ("--set", "companion.streams.window_s=0.5")
# The shortest mission there is: up half a metre and down again.
HOP = ("--set", "items=[{takeoff: {height_m: 0.6}}, {land: {}}]", *QUICK)


def start(*arguments, stdin=subprocess.DEVNULL):
    command = [sys.executable, "-m", "rebound_cli", *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, text=True, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run_here(*arguments):
    """The same without a second of start-up, for what is no matter of processes, signals or pipes."""
    stdout, stderr = io.StringIO(), io.StringIO()
    handlers = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    with contextlib.chdir(ROOT), contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            code = main([*map(str, arguments)])
        except SystemExit as refused:  # argparse's
            code = refused.code
        finally:
            for number, handler in handlers:
                signal.signal(number, handler)
    return subprocess.CompletedProcess(arguments, code, stdout.getvalue(), stderr.getvalue())


def events_of(folder):
    path = folder / "events.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def wait_for_event(folder, kind, timeout_s=30.0, word="", count=1):
    """The event of that kind, with that word in its text, once the flight in `folder` has told of so many."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        found = [event for event in events_of(folder) if event["kind"] == kind and word in event["text"]]
        if len(found) >= count:
            return found[-1]
        time.sleep(0.05)
    raise AssertionError(f"no event '{kind}' with '{word}' within {timeout_s} s: {events_of(folder)}")


@contextlib.contextmanager
def guarding(url, folder, *options):
    """A guard of the vehicle there, ended as systemd ends it. Afterwards `said` is what it printed."""
    guard = start("guard", "--connect", url, "--out", folder, *QUICK, *options)
    try:
        yield guard
        guard.terminate()
        guard.said, stderr = guard.communicate(timeout=20)
    finally:
        guard.kill()
    assert guard.returncode == 0, stderr


def taken_off(vehicle):
    """A pilot's radio; the vehicle holds in the air by now."""
    pilot = mavutil.mavlink_connection(vehicle.mavutil_address)
    pilot.wait_heartbeat(timeout=10)
    vehicle.wait_until(lambda truth: truth.may_arm, within_s=10)
    pilot.arducopter_arm()
    pilot.set_mode("TAKEOFF")
    vehicle.wait_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2, within_s=20)
    return pilot


def processes_naming(text):
    """By their numbers."""
    return [each.pid for each in psutil.process_iter(["cmdline"]) if str(text) in " ".join(each.info["cmdline"] or ())]


def wait_until_there(text, is_there=True):
    """A process that has just been started has no command line for a moment."""
    wait_until(lambda: bool(processes_naming(text)) is is_there, 5.0, f"{text} is there: {is_there}")


def assert_comes_again(folder):
    """What the companion decided in this flight, it decides again from the folder alone, to the bit."""
    _, difference = reproduce(read_recording(folder))
    assert difference is None, difference


def assert_one_clear_sentence(result, *words):
    """One line on stderr that names what is wrong, a non-zero exit, no traceback, nothing on stdout."""
    assert result.returncode not in (0, None)
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("rebound: ")
    for word in words:
        assert str(word) in lines[0], lines[0]
    assert "Traceback" not in result.stderr
