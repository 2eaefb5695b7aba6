"""A run folder as the companion lived it: for each step what came, when, and what the companion did."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from companion.guard.config import GuardConfig
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import source_of
from companion.messages import ComputerStatus
from companion.mission.model import Mission
from companion.shell.tlog import read_tlog
from rebound_cli.documents import validated
from rebound_cli.inputs import load_flown, mission_from
from rebound_cli.logs.log import LogError
from rebound_cli.run_folder import (
    EVENTS_NAME,
    GUARD_NAME,
    INPUTS_NAME,
    RESOLVED_NAME,
    SUMMARY_NAME,
    TLOG_NAME,
    VERSIONS_NAME,
    read_records,
    read_text,
    whole_lines,
)


@dataclass(slots=True)
class Step:
    """One call of the companion's step; what it was told came after it."""

    time_us: int
    received: Sequence[bytes] = ()
    sent: Sequence[bytes] = ()
    confirms: bool = False
    stop_reason: str | None = None
    file_appears: bool = False
    computer: ComputerStatus | None = None
    notes: list[tuple[str, str]] = field(default_factory=list)  # kinds of events and their texts


@dataclass(frozen=True, slots=True)
class Recording:
    """A flight as its folder has it; `event_lines` as they stand in the file.

    `is_cut`: the program was ended at once, and the flight is known only to the last packet that it had written.
    `versions` are those it was flown with.
    """

    settings: Mission | GuardConfig
    steps: Sequence[Step]
    event_lines: Sequence[str]
    is_cut: bool
    versions: Mapping[str, str]


def is_run_folder(path: Path) -> bool:
    return path.is_dir() and (path / TLOG_NAME).exists()


def read_recording(folder: Path) -> Recording:
    """Raises LogError, DocumentError, RunFolderError."""
    inputs_file = folder / INPUTS_NAME
    if not inputs_file.exists():
        raise LogError(
            f"{folder}: no {INPUTS_NAME} in it, so the flight was recorded by a version that cannot be replayed to the "
            f"bit; replay {folder / TLOG_NAME} instead."
        )
    settings = _settings(folder)
    steps = _steps(folder / TLOG_NAME)
    if not steps:
        raise LogError(f"{folder / TLOG_NAME}: no packet in it: nothing was ever heard in this flight.")
    last_packet_us = max(steps)
    is_cut = not (folder / SUMMARY_NAME).exists()
    # Of a flight that was cut off a last line may be unfinished; in any other that is damage.
    inputs, events = (
        whole_lines(text) if is_cut else text for text in (read_text(inputs_file), read_text(folder / EVENTS_NAME))
    )
    for record in read_records(inputs_file, inputs):
        step = steps.setdefault(record["time_us"], Step(record["time_us"]))
        step.confirms |= record["kind"] == "confirm"
        step.file_appears |= record["kind"] == "file"
        step.stop_reason = record.get("reason", step.stop_reason)
        if record["kind"] == "computer":
            step.computer = _computer(inputs_file, record.get("status"))
        if record["kind"] == "note":
            step.notes.append((str(record.get("event")), str(record.get("text"))))
    lines = events.splitlines(keepends=True)
    if is_cut:
        end_us = _whole_until_us(steps, last_packet_us)
        steps = {time_us: step for time_us, step in steps.items() if time_us < end_us}
        if not steps:
            raise LogError(f"{folder}: cut off before a whole step of the flight was written.")
        told = zip(lines, read_records(folder / EVENTS_NAME, events), strict=True)
        lines = [line for line, event in told if event["time_us"] < end_us]
    try:
        versions = dict(json.loads(read_text(folder / VERSIONS_NAME)))
    except (ValueError, TypeError) as error:
        raise LogError(f"{folder / VERSIONS_NAME}: damaged: {error}.") from error
    return Recording(settings, [steps[time_us] for time_us in sorted(steps)], lines, is_cut, versions)


def _computer(file: Path, status: Any) -> ComputerStatus:
    try:
        return ComputerStatus(**{**status, "cpu_percent": tuple(status["cpu_percent"])})
    except (TypeError, KeyError) as error:
        raise LogError(f"{file}: a status of the computer is damaged.") from error


def _whole_until_us(steps: Mapping[int, Step], last_packet_us: int) -> int:
    """Where a flight that was cut off ends: of the step with the last packet perhaps not all was written.

    Nor does it end after a step with notes, which are told with the step after it under the time of their own.
    """
    end_us = last_packet_us
    for time_us in sorted((time_us for time_us in steps if time_us < last_packet_us), reverse=True):
        if not steps[time_us].notes:
            break
        end_us = time_us
    return end_us


def settings_file(folder: Path) -> Path:
    """The mission as it was flown, or the guard's settings."""
    return folder / (GUARD_NAME if (folder / GUARD_NAME).exists() else RESOLVED_NAME)


def _settings(folder: Path) -> Mission | GuardConfig:
    file = settings_file(folder)
    document = load_flown(file)
    return mission_from(document) if file.name == RESOLVED_NAME else validated(GuardConfig, document, document.data)


def _steps(tlog: Path) -> dict[int, Step]:
    """Packets of one stamp belong to one step: first what was received, then what was sent."""
    steps = {}
    for time_us, group in groupby(read_tlog(tlog), key=itemgetter(0)):
        packets = [packet for _, packet in group]
        count = len(packets)
        while count and _is_ours(packets[count - 1]):
            count -= 1
        steps[time_us] = Step(time_us, packets[:count], packets[count:])
    return steps


def _is_ours(packet: bytes) -> bool:
    return source_of(packet)[1] == int(COMPONENT_ID)
