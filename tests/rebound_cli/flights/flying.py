"""Small flights on disk: one that a guard really decided, and folders that only look like flights."""

from dataclasses import asdict

from pymavlink.dialects.v20 import development as dialect

from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.messages import ComputerStatus
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder

EPOCH_US = 1_600_000_000_000_000
STEP_US = 50_000
BLOCK = 4096
COMPUTER = ComputerStatus(EPOCH_US, 90_500, (5, 50), 61, 812, 3792, 9_000, 30_000)


def record(folder, steps=50, writer=None, make_room=None):
    """A guard on a vehicle that says little, for some seconds; as a kill leaves it: without a summary."""
    settings = {"companion": {"streams": {"window_s": 0.5}}}
    config = GuardConfig.model_validate(settings)
    run_folder.write_yaml(folder / run_folder.GUARD_NAME, settings)
    run_folder.write_json(folder / run_folder.VERSIONS_NAME, run_folder.versions())
    vehicle, guard = dialect.MAVLink(None, 1, 1), Guard(config)
    recorder = FlightRecorder(folder, writer, make_room)
    for number in range(steps):
        now_us = EPOCH_US + number * STEP_US
        messages = []
        if number % 20 == 5:
            messages.append(dialect.MAVLink_heartbeat_message(2, 12, 81, 4 << 16 | 3 << 24, 3, 3))
        if number % 3 == 1:
            messages.append(dialect.MAVLink_attitude_message(number * 50, 0.01, 0.02, 0.03, 0.0, 0.0, 0.0))
        recorder.record(now_us, guard.step(b"".join(message.pack(vehicle) for message in messages), now_us))
        if number == 20:
            guard.tell_computer(COMPUTER)
            recorder.record_input(now_us, "computer", status=asdict(COMPUTER))
        if number == 30:
            guard.note("late", "a step came late")
            recorder.record_input(now_us, "note", event="late", text="a step came late")
    recorder.close()
    return recorder


def pretend(runs, name, size=BLOCK, hits=0, summary=None):
    """A folder with the files by which a flight is known."""
    folder = runs / name
    folder.mkdir(parents=True)
    (folder / run_folder.TLOG_NAME).write_bytes(bytes(size))
    lines = ['{"time_us": 1000000, "kind": "connected", "text": "connected", "data": {}}']
    lines += ['{"time_us": 3500000, "kind": "detection", "text": "hit", "data": {}}'] * hits
    (folder / run_folder.EVENTS_NAME).write_text("\n".join(lines) + "\n")
    if summary is not None:
        run_folder.write_json(folder / run_folder.SUMMARY_NAME, summary)
    return folder
