"""What a person sees: the live line during a flight, the timeline and the figures of each hit after it."""

import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from rebound_cli.background import Background, at_once

if TYPE_CHECKING:
    from companion.report import Event, Status

# Ten times a second looks continuous; in a file or a pipe a line every few seconds is enough to see life.
LIVE_INTERVAL_S = 0.1
PLAIN_INTERVAL_S = 5.0

_WIDEST_TEXT = 110

_ERASE_LINE = "\r\x1b[K"


class Console:
    """Text for a person, on stdout or, when stdout belongs to a program, on stderr.

    With a `writer` nothing waits for the terminal, or for the reader of a pipe, before `close`.
    """

    def __init__(self, stream: TextIO, writer: Background | None = None) -> None:
        self._stream = stream
        self.writer = writer
        self._do = at_once if writer is None else writer.give
        self.is_terminal = stream.isatty()
        self._live_due_s = 0.0
        self._live_is_shown = False
        self.live_is_held = False  # while a question waits for its answer

    def live(self, status: "Callable[[], Status]", flight_time_s: float) -> None:
        """Show the state now if a fresh line is due."""
        now_s = time.monotonic()
        if now_s < self._live_due_s or self.live_is_held:
            return
        self._live_due_s = now_s + (LIVE_INTERVAL_S if self.is_terminal else PLAIN_INTERVAL_S)
        line = live_text(status(), flight_time_s)
        if self.is_terminal:
            width = shutil.get_terminal_size().columns - 1
            self._do(self._write, _ERASE_LINE + line[:width])
            self._live_is_shown = True
        else:
            self.print(line)

    def print(self, text: str = "") -> None:
        before = _ERASE_LINE if self._live_is_shown else ""
        self._live_is_shown = False
        self._do(self._write, f"{before}{text}\n")

    def ask(self, question: str) -> None:
        """Print a question whose answer is read elsewhere; live lines wait until it has come."""
        self.print()
        self._do(self._write, question)
        self.live_is_held = True

    def close(self) -> None:
        """Return when all is shown that could be. Raises what kept the rest from it."""
        if self.writer is not None:
            self.writer.close()
            if self.writer.error is not None:
                raise self.writer.error

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def console_for(json_on_stdout: bool, writer: Background | None = None) -> Console:
    return Console(sys.stderr if json_on_stdout else sys.stdout, writer)


def live_text(status: "Status", flight_time_s: float) -> str:
    """One line of 80 columns: companion's state, vehicle's mode, local NED position, speed, round trip, detector."""
    lead = f"{flight_time_s:6.1f} s  {status.state:<10} "
    if not status.vehicle_mode:
        return lead + "no vehicle heard yet"
    mode = status.vehicle_mode if status.armed else f"{status.vehicle_mode} (disarmed)"
    position, speed_m_s = status.position_ned_m, status.speed_m_s
    where = "no position" if position is None else "{:+.2f} {:+.2f} {:+.2f} m".format(*position)
    speed = "" if speed_m_s is None else f"  {speed_m_s:.2f} m/s"
    trip = "" if status.round_trip_us is None else f"  RTT {status.round_trip_us / 1e3:.0f} ms"
    return f"{lead} {mode}  {where}{speed}{trip}  detector {status.detector}"


def timeline(events: "Sequence[Event]", started_at_us: int) -> str:
    width = min(shutil.get_terminal_size().columns, _WIDEST_TEXT)
    lines = []
    for event in events:
        lead = f"{(event.time_us - started_at_us) / 1e6:9.3f} s  {event.kind:<10}  "
        hanging = " " * len(lead)
        lines.append(textwrap.fill(event.text, width, initial_indent=lead, subsequent_indent=hanging))
    return "\n".join(lines)


def summary_text(summary: Mapping[str, Any]) -> str:
    """The outcome and the figures of each hit."""
    parts = [_headline(summary)]
    for number, collision in enumerate(summary["collisions"], start=1):
        parts.append(_collision_text(number, collision))
    if summary["obstacles"] or summary["unreachable"]:
        parts.append(_surroundings(summary))
    counts = _counts(summary)
    if counts:
        parts.append(counts)
    return "\n\n".join(parts)


def _headline(summary: Mapping[str, Any]) -> str:
    airframe = summary["airframe"]
    vehicle = "" if airframe is None else f" with the {airframe} airframe, seed {summary['seed']}"
    reason = "" if summary["outcome"] == "completed" else f": {summary['reason']}"
    pace = f"{summary['duration_s']:.1f} s of flight in {summary['wall_clock_s']:.1f} s"
    return f"{summary['mission']} {summary['outcome']}{reason} ({pace}{vehicle})"


def _surroundings(summary: Mapping[str, Any]) -> str:
    """What is known at the end, and what could not be reached for it."""
    from companion.memory.stored import KnownPatch, describe

    lines = [f"  remembered: {describe(KnownPatch.model_validate(data).patch())}" for data in summary["obstacles"]]
    lines += [f"  out of reach: {name if name == 'home' else f'item {name}'}" for name in summary["unreachable"]]
    return "\n".join(lines)


def _counts(summary: Mapping[str, Any]) -> str:
    if summary["false_detections"] is None:
        return ""
    return (
        f"  false detections {summary['false_detections']}, missed contacts {summary['missed_contacts']}, "
        f"recontacts {summary['recontacts']}"
    )


def _collision_text(number: int, collision: Mapping[str, Any]) -> str:
    truth = collision["truth"] or {}
    rows = [
        (
            "speed before",
            _figure(collision["impact_speed_m_s"], "m/s"),
            _speed(truth.get("impact_velocity_ned_m_s")),
        ),
        (
            "speed after",
            _figure(collision["rebound_speed_m_s"], "m/s") or "not known",
            _figure(truth.get("rebound_speed_m_s"), "m/s"),
        ),
        ("obstacle faces (NED)", _vector(collision["normal_ned"]), _vector(truth.get("normal_ned"))),
        ("past the setpoint", _figure(collision["overshoot_m"], "m"), _figure(truth.get("overshoot_m"), "m")),
    ]
    detected = f"detected at {collision['detected_at_s']:.3f} s by '{collision['detector']}'"
    lines = [f"  hit {number}: {detected}{_latency(truth)}"]
    lines.append(f"    {'':<24}{'companion':<22}{'truth' if truth else ''}".rstrip())
    lines.extend(f"    {name:<24}{seen:<22}{true}".rstrip() for name, seen, true in rows)
    settled_s = collision["settled_after_s"]
    singles = [
        ("peak specific force", _figure(collision["peak_specific_force_m_s2"], "m/s^2", 1)),
        ("setpoint, local NED", f"{_vector(collision['recovery_setpoint_ned_m'])} m"),
        ("settled", "not before the flight went on" if settled_s is None else f"{settled_s:.2f} s after"),
    ]
    if truth:
        contact_ms, fold_mm = 1e3 * truth["contact_duration_s"], 1e3 * truth["max_fold_m"]
        force = f"{truth['peak_force_n']:.0f} N, factor of safety {truth['factor_of_safety']:.2f}"
        singles.append(("contact", f"{contact_ms:.1f} ms, at most {force}"))
        singles.append(("arms folded by", f"at most {fold_mm:.1f} mm"))
        singles.append(("height lost", _figure(truth["height_lost_m"], "m")))
    lines.extend(f"    {name:<24}{text}" for name, text in singles)
    return "\n".join(lines)


def _latency(truth: Mapping[str, Any]) -> str:
    return f", {truth['detection_latency_ms']:.1f} ms after contact" if truth else ""


def _figure(value: float | None, unit: str, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f} {unit}"


def _speed(velocity: Sequence[float] | None) -> str:
    return "" if velocity is None else _figure(sum(component**2 for component in velocity) ** 0.5, "m/s")


def _vector(vector: Sequence[float] | None) -> str:
    if vector is None:
        return ""
    # adding 0.0 turns a rounded -0.0 into 0.0
    return "({})".format(", ".join(f"{round(component, 2) + 0.0:.2f}" for component in vector))
