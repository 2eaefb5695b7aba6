"""Everything that the page shows, as data: what `page.js` and its neighbours read.

Columns of numbers are text: whole multiples of a resolution, little-endian, base64.
"""

import base64
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.reflex.config import LONGEST_STEP_US
from companion.reflex.detection.detector import Phase
from rebound_cli.replay.listening import PHASES, Numbers
from rebound_cli.report.moments import Moment, moments_of
from rebound_cli.report.scene import modes, obstacles, recovering, rounded_s, surfaces, vehicle
from rebound_cli.report.series import FORCE_M_S2, PLACES, RATIO, TIME_S, Columns, of_truth, series, times
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.report.tail import COLUMNS
from rebound_cli.report.words import lines, link_rows, sentence
from rebound_cli.results.flight_log import Floats

# All rows of half a minute at 250 Hz, and ten a second more of what is longer: below 2 MB for minutes, 5 MB for half an
# hour.
_ROWS, _ROWS_PER_S = 7_000, 10.0
# Around a moment all rows are kept: the microscope's 150 ms, and the slow motion's way there and back.
AROUND_S = 1.0

# What a page has not before the flight is over.
UNFLOWN = {"hides": ["h-moments", "h-link"]}

# The names of all quantities end in frame and unit: these are the places. In texts they are [north, east, down].
_PLACE_KEYS = re.compile(r".*(_ned_m|_ne_m|latitude_deg|longitude_deg|altitude_m)|obstacles|polygon.*")
_PLACES_IN_TEXT = re.compile(r"\[-?\d[\d.]*(?:, -?\d[\d.]*)+\]")


def content(flight: ShownFlight, no_position: bool = False) -> dict[str, Any]:
    """Without coordinates where they are not wanted."""
    moments = moments_of(flight)
    events = [_event(flight, event) for event in _told(flight)]
    data = {
        "name": flight.name,
        "sentence": sentence(flight),
        "lines": lines(flight),
        "duration_s": flight.ended_s,
        "averaging_ms": flight.config.estimate.imu_averaging_interval_s * 1e3,
        "tables": _tables(flight, moments),
        "moments": [_moment(flight, moment) for moment in moments],
        # Velocities further apart than this are not compared.
        "jump_held_s": 1e-6 * LONGEST_STEP_US,
        "modes": modes(flight),
        "recovering": recovering(flight),
        "obstacles": obstacles(flight),
        "surfaces": surfaces(flight),
        "vehicle": vehicle(flight),
        "has_places": not no_position,
        "link": link_rows(flight),
        "events": events,
        "summary": flight.summary,
        "versions": flight.versions,
    }
    return _without_places(data) if no_position else data


def _without_places(data: dict[str, Any]) -> dict[str, Any]:
    """Neither in what is drawn nor in texts and in the summary."""
    shown = ("name", "sentence", "lines", "events", "summary", "moments")
    kept = data | {key: without_places(data[key]) for key in shown} | {"obstacles": [], "surfaces": []}
    for moment in kept["moments"]:
        moment["place"] = None
    for table in kept["tables"].values():
        table["columns"] = {name: column for name, column in table["columns"].items() if name not in PLACES}
    return kept


def without_places(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: without_places(value) for key, value in data.items() if not _PLACE_KEYS.fullmatch(str(key))}
    if isinstance(data, list):
        return [without_places(value) for value in data]
    return _PLACES_IN_TEXT.sub("[left out]", data) if isinstance(data, str) else data


def live_content(flight: ShownFlight) -> dict[str, Any]:
    """Before anything has come: empty tables of what a live flight brings."""
    empty = packed(np.array([]), 1.0)
    tables = {
        name: {"of": 0, "rows": 0, "columns": {column: {**empty, "kind": "i4"} for column in columns}}
        for name, columns in {**COLUMNS, "imu": ("t",)}.items()
    }
    told = {"sentence": "Waiting for the flight.", "headings": {"h-replay": "Live"}}
    return content(flight) | UNFLOWN | told | {"live": True, "tables": tables}


def _told(flight: ShownFlight) -> Sequence[Mapping[str, Any]]:
    """Events, and what was said to the ground station by whomever."""
    texts = [{"time_us": at_us, "kind": "STATUSTEXT", "text": text} for at_us, text in flight.log.texts]
    return sorted([*flight.events, *texts], key=lambda event: float(event["time_us"]))


def _event(flight: ShownFlight, event: Mapping[str, Any]) -> dict[str, Any]:
    return {"t": rounded_s(flight, event["time_us"]), "kind": event["kind"], "text": str(event.get("text", ""))}


# --- tables -----------------------------------------------------------------------------------------------------


def _tables(flight: ShownFlight, moments: Sequence[Moment]) -> dict[str, Any]:
    """Of each stream; `t` is seconds since the flight began, `boot` those of the vehicle's clock since its first."""
    log, truth = flight.log, flight.truth
    near_s = np.array([flight.seconds(moment.at_us) for moment in moments])
    most = _ROWS + round(_ROWS_PER_S * flight.ended_s)
    tested = _tested_columns(flight)
    ratio = tested.pop("ratio")
    first_us = log.imu_time_boot_us[0] if len(log.imu_time_boot_us) else 0.0
    columns = series(log, flight.started_at_us)
    columns["imu"] = _on_both_clocks(columns["imu"], log.imu_time_boot_us - first_us)
    columns["imu"] |= {name: (values, FORCE_M_S2 if name != "phase" else 1.0) for name, values in tested.items()}
    watches = tested["phase"] >= PHASES.index(Phase.ARMED)
    columns["imu"]["ratio"] = (np.where(watches, ratio, np.nan), RATIO)
    jumps = flight.findings.listener.velocities.all()
    columns["jump"] = times(heard_at_us(flight, jumps.time_boot_us), flight.started_at_us) | {
        "ratio": (np.where(jumps.phase >= PHASES.index(Phase.ARMED), jumps.ratio, np.nan), RATIO)
    }
    columns["path"] = _on_both_clocks(columns["path"], log.position_time_boot_us - first_us)
    if truth is not None and truth.series:
        told_us = truth.told_us(truth.series["time_boot_us"]) - first_us
        columns["truth"] = _on_both_clocks(of_truth(truth, flight.started_at_us), told_us)
    return {name: _packed(table, ratio if name == "imu" else None, near_s, most) for name, table in columns.items()}


def _on_both_clocks(columns: Columns, boot_us: Floats) -> Columns:
    """With the vehicle's clock beside the computer's."""
    return {"t": columns["t"], "boot": (boot_us * 1e-6, TIME_S)} | columns


def _tested_columns(flight: ShownFlight) -> dict[str, Floats]:
    """What the detector made of each IMU sample of the log; NaN of those it never got."""
    tested = flight.findings.listener.forces.all()
    # Of a stamp that came twice, after a reboot, the last.
    row_of = {stamp_us: row for row, stamp_us in enumerate(np.ravel(tested.time_boot_us).tolist())}
    rows = [row_of.get(boot_us, -1) for boot_us in flight.log.imu_time_boot_us.tolist()]
    columns = {"phase": tested.phase, "ratio": tested.ratio}
    for sign, (value, limit) in tested.signs.items():
        columns |= {sign: value, f"{sign}_threshold": limit}
    return {name: np.append(column, np.nan)[rows] for name, column in columns.items()}


def heard_at_us(flight: ShownFlight, boot_us: Numbers) -> Floats:
    """When what has these times on the vehicle's clock was heard, by the IMU samples around it."""
    boot_us, log = np.asarray(boot_us), flight.log
    return np.interp(_going_on(boot_us), _going_on(log.imu_time_boot_us), log.imu_at_us) if len(boot_us) else boot_us


def _going_on(boot_us: Floats) -> Floats:
    """Times of a clock that may begin anew, as of one that goes on: with three years for each time."""
    return boot_us + 1e14 * np.cumsum(np.diff(boot_us, prepend=boot_us[:1]) < -1e6)


def _packed(columns: Columns, loudness: Floats | None, near_s: Floats, most: int) -> dict[str, Any]:
    seconds = columns["t"][0]
    rows = kept_rows(seconds, np.zeros(len(seconds)) if loudness is None else loudness, near_s, AROUND_S, most)
    return {
        "of": len(seconds),
        "rows": len(rows),
        "columns": {name: packed(values[rows], resolution) for name, (values, resolution) in columns.items()},
    }


def _moment(flight: ShownFlight, moment: Moment) -> dict[str, Any]:
    boot_us = flight.log.imu_time_boot_us
    first_us = boot_us[0] if len(boot_us) else 0.0
    touched_us = moment.touched_boot_us
    return {
        "kind": moment.kind,
        "title": moment.title,
        "t": rounded_s(flight, moment.at_us),
        "boot": round((moment.boot_us - first_us) * 1e-6, 6),
        "touched_ms": None if touched_us is None else round((touched_us - moment.boot_us) / 1e3, 3),
        "facts": moment.facts,
        "reasons": moment.reasons,
        "place": moment.position_ned_m,
        "normal": moment.normal_ned,
        "error_deg": round(moment.normal_error_deg, 1),
    }


def as_text(data: Mapping[str, Any]) -> str:
    """JSON that a script element can hold, whatever was heard on the wire: no character in it can end the element."""
    text = json.dumps(finite(data), separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def finite(data: Any) -> Any:
    """JSON has no NaN: it becomes null."""
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [finite(value) for value in data]
    return data


# --- columns ----------------------------------------------------------------------------------------------------

# The most negative number stands for "none".
NONE = {"i2": -(1 << 15), "i4": -(1 << 31)}


def packed(values: Floats, resolution: float) -> dict[str, Any]:
    """One column, of two bytes a number where that fits, else of four; what is not finite is none."""
    finite = values[np.isfinite(values)]
    low, high = (math.floor(finite.min() / resolution), math.ceil(finite.max() / resolution)) if len(finite) else (0, 0)
    middle = (low + high) // 2
    kind = "i2" if high - low < 65_000 else "i4"
    # What four bytes cannot hold is none: of times in steps of 10 us what is six hours from the middle.
    steps = np.round(values / resolution) - middle
    held = np.isfinite(steps) & (np.abs(steps) < -NONE[kind])
    whole = np.where(held, np.where(held, steps, 0.0), NONE[kind]).astype(f"<{kind}")
    return {
        "kind": kind,
        "offset": middle,
        "resolution": resolution,
        "data": base64.b64encode(whole.tobytes()).decode(),
    }


def kept_rows(seconds: Floats, loudness: Floats, near_s: Floats, around_s: float, most: int) -> npt.NDArray[np.int64]:
    """Which rows of a long flight are shown: all around the moments `near_s`, elsewhere the loudest of each stretch.

    Of at most `most` rows all are.
    """
    count = len(seconds)
    if count <= most:
        return np.arange(count)
    keep = np.zeros(count, bool)
    for moment_s in near_s:
        keep |= np.abs(seconds - moment_s) <= around_s
    left = np.flatnonzero(~keep)
    # NaN is never the loudest.
    order = np.nan_to_num(loudness, nan=-np.inf)
    for part in np.array_split(left, max(most - int(keep.sum()), most // 4)):
        if len(part):
            keep[part[np.argmax(order[part])]] = True
    return np.flatnonzero(keep)
