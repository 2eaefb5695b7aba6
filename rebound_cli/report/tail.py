"""A run's folder read while it grows: what a live page needs of each half second, in ten rows a second.

Only files are read: the program that flies knows nothing of it.
"""

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from companion.shell.tlog import packets_in
from rebound_cli.report.series import NED, TURN, VELOCITY, series
from rebound_cli.results import run_folder
from rebound_cli.results.flight_log import FlightLog, Floats, flight_log_of_packets

# Columns of each table of the page, in the order of a row.
COLUMNS = {
    "path": ("t", *NED, *VELOCITY, "speed", "height"),
    "attitude": ("t", *TURN, "roll", "pitch", "tilt"),
    "target": ("t", "tilt", "thrust"),
    "wanted": ("t", "tilt", "thrust"),
    "setpoint": ("t", *NED),
    "force": ("t", "peak"),
}
# As often as a person's eyes can follow, as `rebound status`.
ROW_S = 0.1
# Ten minutes of PX4's fastest streams in some twenty steps: a page that comes late sees the flight grow to now.
_MOST_BYTES = 4_000_000
_DIGITS = 4


class Tail:
    """Where reading has come to."""

    def __init__(self, folder: Path) -> None:
        self._tlog, self._events = folder / run_folder.TLOG_NAME, folder / run_folder.EVENTS_NAME
        self._tlog_at = self._events_at = 0
        self._started_us: int | None = None
        self._row_s = dict.fromkeys(COLUMNS, -math.inf)
        self._peaks: list[float] = []  # since the last row of them

    def read(self) -> Mapping[str, Any] | None:
        """What has come since; None where nothing has."""
        packets = self._packets()
        if not packets and self._started_us is None:
            return None
        if self._started_us is None:
            self._started_us = packets[0][0]
        rows = self._rows(flight_log_of_packets(packets))
        events = [self._event(record) for record in self._records()]
        if not packets and not events:
            return None
        times_s = [self._seconds(packets[-1][0])] if packets else []
        return {"until": max([*times_s, *(event["t"] for event in events)]), "rows": rows, "events": events}

    def _packets(self) -> list[tuple[int, bytes]]:
        content = _read(self._tlog, self._tlog_at)
        found = list(packets_in(content))
        if found:
            self._tlog_at += found[-1][2]
        return [(stamp_us, packet) for stamp_us, packet, _ in found]

    def _records(self) -> Iterator[Mapping[str, Any]]:
        content = _read(self._events, self._events_at)
        whole = content[: content.rfind(b"\n") + 1]
        self._events_at += len(whole)
        return run_folder.read_records(self._events, whole.decode("utf-8", "replace"))

    def _event(self, record: Mapping[str, Any]) -> dict[str, Any]:
        text = str(record.get("text", ""))
        return {"t": self._seconds(record["time_us"]), "kind": record["kind"], "text": text}

    def _seconds(self, at_us: float) -> float:
        return round((at_us - (self._started_us or 0)) * 1e-6, 6)

    def _rows(self, log: FlightLog) -> dict[str, list[list[float | None]]]:
        columns = series(log, self._started_us or 0)
        side = np.hypot(columns["imu"]["fx"][0], columns["imu"]["fy"][0])
        rows = {
            name: self._thinned(name, np.column_stack([columns[name][column][0] for column in shown]))
            for name, shown in COLUMNS.items()
            if name in columns
        }
        return {**rows, "force": self._thinned("force", np.column_stack([columns["imu"]["t"][0], side]), peaks=True)}

    def _thinned(self, name: str, table: Floats, peaks: bool = False) -> list[list[float | None]]:
        """A row each tenth of a second; of `peaks` the largest since the row before."""
        rows: list[list[float | None]] = []
        for exactly_s, *values in table.tolist():
            seconds = round(exactly_s, 6)
            if peaks:
                values = self._peaks = [*map(max, values, self._peaks or values)]
            if seconds - self._row_s[name] < ROW_S:
                continue
            shown, self._row_s[name] = values, seconds
            if peaks:
                self._peaks = []
            rows.append([seconds, *(round(one, _DIGITS) if math.isfinite(one) else None for one in shown)])
        return rows


def _read(path: Path, position: int) -> bytes:
    """A piece of a file that may not be there yet."""
    try:
        with path.open("rb") as file:
            file.seek(position)
            return file.read(_MOST_BYTES)
    except FileNotFoundError:
        return b""


def as_line(chunk: Mapping[str, Any]) -> bytes:
    """One message of server-sent events."""
    return b"data: " + json.dumps(chunk, allow_nan=False, separators=(",", ":")).encode() + b"\n\n"
