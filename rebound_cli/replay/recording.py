"""A run folder as the companion lived it: for each step what came, when, and what the companion did."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from companion.mavlink.encode import COMPONENT_ID
from companion.mission.model import Mission
from companion.shell.tlog import read_tlog
from rebound_cli.documents import load_document
from rebound_cli.inputs import mission_from
from rebound_cli.logs.log import LogError
from rebound_cli.run_folder import EVENTS_NAME, INPUTS_NAME, RESOLVED_NAME, TLOG_NAME

_MAGIC_V2 = 0xFD


@dataclass(slots=True)
class Step:
    """One call of the companion's step; the person's word came after it."""

    time_us: int
    received: Sequence[bytes] = ()
    sent: Sequence[bytes] = ()
    confirms: bool = False
    stop_reason: str | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A flight as its folder has it; `event_lines` as they stand in the file."""

    mission: Mission
    steps: Sequence[Step]
    event_lines: Sequence[str]
    versions: dict[str, str] = field(default_factory=dict)


def is_run_folder(path: Path) -> bool:
    return path.is_dir() and (path / TLOG_NAME).exists()


def read_recording(folder: Path) -> Recording:
    """Raises LogError, DocumentError."""
    inputs_file = folder / INPUTS_NAME
    if not inputs_file.exists():
        raise LogError(
            f"{folder}: no {INPUTS_NAME} in it, so the flight was recorded by a version that cannot be replayed to the "
            f"bit; replay {folder / TLOG_NAME} instead."
        )
    mission = mission_from(load_document(folder / RESOLVED_NAME))
    steps = _steps(folder / TLOG_NAME)
    for record in _records(inputs_file):
        step = steps.setdefault(record["time_us"], Step(record["time_us"]))
        step.confirms |= record["kind"] == "confirm"
        step.stop_reason = record.get("reason", step.stop_reason)
    lines = (folder / EVENTS_NAME).read_text(encoding="utf-8").splitlines(keepends=True)
    return Recording(mission, [steps[time_us] for time_us in sorted(steps)], lines)


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
    return packet[6 if packet[0] == _MAGIC_V2 else 4] == int(COMPONENT_ID)


def _records(path: Path) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            record = json.loads(line)
            record["time_us"], record["kind"] = int(record["time_us"]), str(record["kind"])
        except (ValueError, KeyError, TypeError) as error:
            raise LogError(f"{path}:{number}: not a record of a step; the file is damaged.") from error
        yield record
