"""The results of a campaign in a file that only grows: one line an outcome, so that a broken-off run goes on."""

import json
from pathlib import Path
from typing import Any, TextIO

from bench.campaign.plan import Campaign, Outcome
from companion.errors import ReboundError


class RecordError(ReboundError):
    """A file of results that cannot be used."""


class Record:
    """The outcomes known so far by case number, and the open file behind them."""

    def __init__(self, campaign: Campaign, folder: Path) -> None:
        """Open the campaign's file, or begin it. Raises RecordError where other lines are in it."""
        self.path = record_path(campaign, folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.outcomes: dict[int, Outcome] = {}
        head = {"campaign": campaign.name, "version": campaign.version, "parameters": dict(campaign.parameters)}
        self._file = self._open(json.loads(json.dumps(head)))

    def _open(self, head: dict[str, Any]) -> TextIO:
        _cut_torn_line(self.path)
        known, self.outcomes = outcomes_in(self.path) if self.path.exists() else (None, {})
        if known not in (None, head):
            raise RecordError(f"{self.path} holds another campaign's results; move it away.")
        file = self.path.open("a", encoding="utf-8")
        if known is None:
            _write(file, head)
        return file

    def add(self, outcome: Outcome) -> None:
        """Keep an outcome, in the file first."""
        entry: dict[str, Any] = {"case": outcome.number}
        entry |= {"failure": outcome.failure} if outcome.result is None else {"result": outcome.result}
        # Read back as it will be by a run that goes on: numbers then are the same bits either way.
        entry = _write(self._file, entry)
        self.outcomes[outcome.number] = Outcome(outcome.number, entry.get("result"), entry.get("failure"))

    def add_from_another_process(self, outcome: Outcome) -> None:
        """Keep one that a worker has written to the file by `append`."""
        self.outcomes[outcome.number] = outcome

    def close(self) -> None:
        self._file.close()


def record_path(campaign: Campaign, folder: Path) -> Path:
    return folder / f"{campaign.name}-{campaign.key}.jsonl"


def outcomes_in(path: Path) -> tuple[dict[str, Any] | None, dict[int, Outcome]]:
    """The head of a file of results, None in an empty one, and the outcomes by case number; without half a line at its
    end, of a campaign that goes on or was killed. Raises RecordError, OSError.
    """
    content = path.read_bytes()
    head, outcomes = None, {}
    for number, line in enumerate(content[: content.rfind(b"\n") + 1].splitlines(), start=1):
        try:
            entry = dict(json.loads(line))
            if number == 1:
                head = entry
            else:
                outcomes[entry["case"]] = Outcome(entry["case"], entry.get("result"), entry.get("failure"))
        except (ValueError, KeyError, TypeError) as error:
            raise RecordError(f"{path} is damaged in line {number}; move it away.") from error
    return head, outcomes


def _write(file: TextIO, entry: dict[str, Any]) -> dict[str, Any]:
    line = json.dumps(entry, separators=(",", ":"))
    file.write(line + "\n")
    file.flush()
    read_back: dict[str, Any] = json.loads(line)
    return read_back


def append(path: Path, outcome: Outcome) -> None:
    """Write a result from a worker: a line of a file that is open for appending is written at once."""
    with path.open("a", encoding="utf-8") as file:
        _write(file, {"case": outcome.number, "result": outcome.result})


def _cut_torn_line(path: Path) -> None:
    """A run that was killed while it wrote leaves half a line at the end."""
    if not path.exists():
        return
    content = path.read_bytes()
    if content and not content.endswith(b"\n"):
        path.write_bytes(content[: content.rfind(b"\n") + 1])
