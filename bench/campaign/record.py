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
        self.path = folder / f"{campaign.name}-{campaign.key}.jsonl"
        folder.mkdir(parents=True, exist_ok=True)
        self.outcomes: dict[int, Outcome] = {}
        head = {"campaign": campaign.name, "version": campaign.version, "parameters": dict(campaign.parameters)}
        self._file = self._open(json.loads(json.dumps(head)))

    def _open(self, head: dict[str, Any]) -> TextIO:
        _cut_torn_line(self.path)
        lines = self.path.read_bytes().splitlines() if self.path.exists() else []
        for number, line in enumerate(lines):
            try:
                entry = json.loads(line)
                if number > 0:
                    self.outcomes[entry["case"]] = Outcome(entry["case"], entry.get("result"), entry.get("failure"))
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                raise RecordError(f"{self.path} is damaged in line {number + 1}; move it away.") from error
            if number == 0 and entry != head:
                raise RecordError(f"{self.path} holds another campaign's results; move it away.")
        file = self.path.open("a", encoding="utf-8")
        if not lines:
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
