"""A run folder as the companion lived it, and the flight decided again.

For each step it is known what came, when, and what the companion did: the same bytes at the same times go through the
whole companion once more.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from companion.companion import Companion, StepResult
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import source_of
from companion.messages import Asked, ComputerStatus
from companion.mission.model import Mission
from companion.shell.tlog import read_tlog
from rebound_cli.inputs.documents import load_document, validated
from rebound_cli.inputs.inputs import mission_from
from rebound_cli.logs.log import LogError, vector
from rebound_cli.replay.watching import Findings
from rebound_cli.results import run_folder


@dataclass(slots=True)
class RecordedStep:
    """One call of the companion's step; `told`: what it was told after it, as `inputs.jsonl` has it."""

    time_us: int
    received: Sequence[bytes] = ()
    sent: Sequence[bytes] = ()
    told: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Recording:
    """A flight as its folder has it; `event_lines` as they stand in the file.

    `is_cut`: the program was ended at once, and the flight is known only to the last packet that it had written.
    `versions` are those it was flown with.
    """

    settings: Mission | GuardConfig
    steps: Sequence[RecordedStep]
    event_lines: Sequence[str]
    is_cut: bool
    versions: Mapping[str, str]


def is_run_folder(path: Path) -> bool:
    return path.is_dir() and (path / run_folder.TLOG_NAME).exists()


def log_file(path: Path) -> Path:
    """A run's folder stands for its packets. Raises LogError for any other folder."""
    if not path.is_dir():
        return path
    if not is_run_folder(path):
        raise LogError(f"{path}: no {run_folder.TLOG_NAME} in this folder; give a run's folder or a file.")
    return path / run_folder.TLOG_NAME


def read_recording(folder: Path) -> Recording:
    """Raises LogError, DocumentError, RunFolderError."""
    inputs_file, tlog = folder / run_folder.INPUTS_NAME, folder / run_folder.TLOG_NAME
    if not inputs_file.exists():
        text = f"no {inputs_file.name} in it, so the flight was recorded by a version that no replay repeats to the bit"
        raise LogError(f"{folder}: {text}; replay {tlog} instead.")
    settings = read_settings(folder)
    steps = _steps(tlog)
    if not steps:
        raise LogError(f"{tlog}: no packet in it: nothing was ever heard in this flight.")
    end_us, is_cut = max(steps), not (folder / run_folder.SUMMARY_NAME).exists()
    # Of a flight that was cut off a last line may be unfinished; in any other that is damage.
    inputs, events = (run_folder.read_text(folder / name) for name in (inputs_file.name, run_folder.EVENTS_NAME))
    if is_cut:
        inputs, events = run_folder.whole_lines(inputs), run_folder.whole_lines(events)
    for record in run_folder.read_records(inputs_file, inputs):
        steps.setdefault(record["time_us"], RecordedStep(record["time_us"])).told.append(record)
    lines = events.splitlines(keepends=True)
    if is_cut:
        # Of the step with the last packet perhaps not all was written. Nor does the flight end after a step with
        # notes, which are told with the step after it under the time of their own.
        for time_us in sorted((time_us for time_us in steps if time_us < end_us), reverse=True):
            if all(record["kind"] != "note" for record in steps[time_us].told):
                break
            end_us = time_us
        steps = {time_us: step for time_us, step in steps.items() if time_us < end_us}
        if not steps:
            raise LogError(f"{folder}: cut off before a whole step of the flight was written.")
        told = zip(lines, run_folder.read_records(folder / run_folder.EVENTS_NAME, events), strict=True)
        lines = [line for line, event in told if event["time_us"] < end_us]
    versions_file, versions = folder / run_folder.VERSIONS_NAME, dict[str, str]()
    # Only told: a flight can be shown and repeated without.
    if versions_file.exists():
        with run_folder.reading(versions_file):
            versions = dict(json.loads(run_folder.read_text(versions_file)))
    return Recording(settings, [steps[time_us] for time_us in sorted(steps)], lines, is_cut, versions)


def read_settings(folder: Path) -> Mission | GuardConfig:
    """Raises DocumentError."""
    file = settings_file(folder)
    document, is_guard = load_document(file), file.name == run_folder.GUARD_NAME
    return validated(GuardConfig, document, document.data) if is_guard else mission_from(document)


def settings_file(folder: Path) -> Path:
    """The mission as it was flown, or the guard's settings."""
    return folder / (run_folder.GUARD_NAME if (folder / run_folder.GUARD_NAME).exists() else run_folder.RESOLVED_NAME)


def _steps(tlog: Path) -> dict[int, RecordedStep]:
    """Packets of one stamp belong to one step: first what was received, then what was sent."""
    steps = {}
    for time_us, group in groupby(read_tlog(tlog), key=itemgetter(0)):
        packets = [packet for _, packet in group]
        count = len(packets)
        while count and source_of(packets[count - 1])[1] == COMPONENT_ID:
            count -= 1
        steps[time_us] = RecordedStep(time_us, packets[:count], packets[count:])
    return steps


def reproduce(recording: Recording) -> tuple[Findings, str | None]:
    """Fly the recording to its end, whatever differs; None when every packet sent and every event is the same to the
    bit, else the first difference.
    """
    settings = recording.settings
    stepped = Guard(settings) if isinstance(settings, GuardConfig) else Companion(settings)
    findings, watch, differences, told = Findings(), None, list[str](), list[str]()
    for step in recording.steps:
        # What the flight knew when the packets came; they may move it on.
        known = stepped.core.situation()
        result = stepped.step(b"".join(step.received), step.time_us)
        monitor = stepped.core.reflex.monitor
        if monitor is not watch:
            findings.listener.listen(monitor)
        watch = monitor
        is_flying = stepped.core.flight.vehicle.is_airborne
        findings.note(monitor, stepped.core.reflex.latest, known, is_flying, step.time_us)
        findings.happenings += ((event.time_us, event.text) for event in result.events)
        differences += _differences(recording.event_lines, step, result, told)
        for record in step.told:
            with run_folder.reading(run_folder.INPUTS_NAME):
                _tell(stepped, record)
    differences += [f"this event did not come again: {line.strip()}" for line in recording.event_lines[len(told) :]]
    findings.close(step.time_us)
    return findings, differences[0] if differences else None


def _differences(expected: Sequence[str], step: RecordedStep, result: StepResult, told: list[str]) -> Iterator[str]:
    """Of a step; its events are added to those `told` so far."""
    for line in map(run_folder.event_line, result.events):
        then = expected[len(told)] if len(told) < len(expected) else None
        told.append(line)
        if then is None:
            yield f"this event is new: {line.strip()}"
        elif line != then:
            yield f"event {len(told)} was {then.strip()} and is {line.strip()}"
    if list(step.sent) != list(result.sent_frames):
        were, are = len(step.sent), len(result.sent_frames)
        what = "another packet was sent" if were == are else f"{were} packets were sent then and {are} now"
        yield f"at {step.time_us} us {what}"


def _tell(stepped: Companion | Guard, record: Mapping[str, Any]) -> None:
    match record, stepped:
        case {"kind": "confirm"}, Companion():
            stepped.confirm_plan()
        case {"kind": "file"}, Companion():
            stepped.file_is_there()
        case {"kind": "stop", "reason": str(reason)}, _:
            stepped.stop(reason)
        case {"kind": "note", "event": event, "text": text}, _:
            stepped.note(str(event), str(text))
        case {"kind": "setpoint"}, Guard():
            asked = (record[name] for name in ("place_ned_m", "velocity_ned_m_s"))
            stepped.hear_setpoint(Asked(*(None if values is None else vector(values) for values in asked)))
        case {"kind": "choice"}, Guard():
            stepped.hear_choice()
        case {"kind": "interval", "message_id": int() | None as message_id, "interval_us": int(interval_us)}, Guard():
            stepped.hear_interval(message_id, interval_us)
        case {"kind": "computer"}, _:
            status = ComputerStatus(**record["status"] | {"cpu_percent": tuple(record["status"]["cpu_percent"])})
            stepped.tell_computer(status)
