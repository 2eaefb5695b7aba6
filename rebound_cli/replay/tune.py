"""`rebound tune`: from healthy flights to what a detector can see on this vehicle, and the settings to fly with.

How near a healthy flight comes to a threshold is found by lowering it until the detector, run itself, takes the flight
for a hit: a threshold is met at the share of it that the flight's largest sign of a hit reaches.
"""

import json
import math
import re
import textwrap
from argparse import Namespace
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from companion.mission.config import CompanionConfig
from companion.shell.files import write_whole
from rebound_cli.flights.kept import hits_in, hits_text
from rebound_cli.inputs.documents import refuse_existing, refuse_special
from rebound_cli.inputs.inputs import companion_settings
from rebound_cli.logs.log import Log, LogError, clipping_text
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.recording import log_file
from rebound_cli.replay.report import Replay, replay_log
from rebound_cli.replay.watching import watch_log
from rebound_cli.results.run_folder import EVENTS_NAME, read_text, whole_lines

# Why a setting is as it is, by its part of `companion:` and its name.
Reasons: TypeAlias = Mapping[tuple[str, str], str]

_WIDTH = 110
# PX4's take-off ramp lasts 3 s (MPC_TKO_RAMP_T) and a landing some 4 s: as long again shows how the noise varies.
_LEAST_FLYING_S = 14.0
# What settings of a detector are compared with the flight, by the words in their names.
_COMPARED = re.compile(r"threshold|factor|step")
# Below the first share a setting is far from mattering; above the last one the vehicle needs another detector. Two
# flights differ from each other by more than a step.
SHARES = [round(0.4 + 0.02 * step, 2) for step in range(181)]
# Other days have other gusts: a threshold stands at least this many times above the largest of these flights.
RESERVE = 1.25


@dataclass(frozen=True, slots=True)
class Margin:
    """`share`: the largest sign of a hit over the threshold; None below SHARES. Above 1 it is a false alarm."""

    setting: str
    value: float
    share: float | None


def run_tune(options: Namespace) -> None:
    """Print what the flights say and the settings; with --out write these. Raises LogError, ConfigurationError."""
    out: Path | None = options.out
    refuse_existing(out)
    if out is not None:
        refuse_special(out)
    config = companion_settings(options.companion)
    flights = [read_healthy(path, config) for path in options.logs]
    # What follows takes longer than such a flight.
    for flight in flights:
        rows = (textwrap.fill(row, _WIDTH, subsequent_indent="    ") for row in _flight_rows(flight))
        print(*rows, sep="\n", end="\n\n", flush=True)
    logs = [flight.log for flight in flights]
    found = margins(logs, config)
    settings, reasons, left = advise(logs, config, found)
    text = settings_text(settings, reasons, ", ".join(path.name for path in options.logs))
    if left:
        alarms = f"{left} false alarm{'s' if left > 1 else ''}"
        print(f"With these settings still {alarms}: this vehicle is not made quiet by thresholds.\n")
    print(text, end="")
    if out is not None:
        write_whole(out, text.encode())
        print(f"\nWritten to {out}. Fly with it: rebound fly MISSION --companion {out} ...")


def read_healthy(path: Path, config: CompanionConfig) -> Replay:
    """A flight without a collision: what the detector made of it.

    Raises LogError for a log that cannot be read, and for a flight that teaches nothing or the wrong thing.
    """
    log = read_log(log_file(path))
    flight, events = replay_log(log, config), path / EVENTS_NAME
    hits = hits_in(whole_lines(read_text(events)).splitlines()) if events.is_file() else 0
    wrong = f"it had {hits_text(hits)}" if hits > 0 else ""
    for crash in flight.findings.crashes:
        wrong = f"it crashed at {log.seconds(crash.at_us):.1f} s"
    if wrong:
        raise LogError(f"{path}: not a healthy flight, {wrong}; tune learns from flights without a hit or a crash.")
    if (flying_s := flight.findings.flown_us * 1e-6) < _LEAST_FLYING_S:
        text = f"too short a flight to learn from, {flying_s:.0f} s in the air; a minute is a good one"
        raise LogError(f"{path}: {text}.")
    return flight


def _flight_rows(flight: Replay) -> Iterator[str]:
    log, found = flight.log, flight.findings
    yield f"{log.path}: {log.vehicle}, {found.flown_us * 1e-6:.0f} s in the air, IMU at {log.imu_rate_hz:.0f} Hz"
    alarms, blind_s = len(found.collisions), sum(span.duration_s for span in found.blind)
    blind = f"blind for {blind_s:.2f} s, first: {found.blind[0].reason}" if found.blind else "never blind"
    yield f"  {clipping_text(log)}"
    yield f"  as set now: {alarms or 'no'} false alarm{'s' if alarms > 1 else ''}, {blind}"
    yield f"  smallest hit that shows: {found.promise.text() if found.promise else 'not known'}"
    yield from (f"  note: {loss}" for loss in log.losses)


def margins(logs: Sequence[Log], config: CompanionConfig) -> list[Margin]:
    """Of each of the detector's thresholds alone, over all flights together."""

    def share(name: str, value: float) -> float | None:
        def is_quiet(share: float) -> bool:
            return not _false_alarms(logs, _with(config, {name: share * value}))

        if is_quiet(SHARES[0]):
            return None
        return SHARES[min(bisect_left(SHARES, True, key=is_quiet), len(SHARES) - 1)]

    settings = getattr(config, config.detector).model_dump()
    return [
        Margin(name, value, share(name, value))
        for name, value in settings.items()
        if isinstance(value, float) and _COMPARED.search(name)
    ]


def _with(config: CompanionConfig, values: Mapping[str, float]) -> CompanionConfig:
    """The same but for some settings of the detector."""
    settings = getattr(config, config.detector).model_copy(update=values)
    return config.model_copy(update={config.detector: settings})


def _false_alarms(logs: Sequence[Log], config: CompanionConfig) -> int:
    """Collisions found in flights that had none."""
    return sum(len(watch_log(log, config).collisions) for log in logs)


def advise(logs: Sequence[Log], start: CompanionConfig, found: Sequence[Margin]) -> tuple[dict[str, Any], Reasons, int]:
    """The `companion:` part: thresholds with a reserve over these flights, never below where they started; and the
    false alarms that are left.
    """
    raised = _raised(logs, start, found)
    settings: dict[str, Any] = {"detector": start.detector, **start.model_dump(mode="json", exclude_unset=True)}
    averaging_s, why_averaging = _averaging(logs, start)
    new = {start.detector: {margin.setting: raised.get(margin.setting, margin.value) for margin in found}}
    for part, values in (new | {"estimate": {"imu_averaging_interval_s": averaging_s}}).items():
        settings[part] = settings.get(part, {}) | values
    reasons = {(start.detector, margin.setting): _why(margin, raised) for margin in found}
    reasons["estimate", "imu_averaging_interval_s"] = why_averaging
    return settings, reasons, _false_alarms(logs, _with(start, raised))


def _raised(logs: Sequence[Log], start: CompanionConfig, found: Sequence[Margin]) -> dict[str, float]:
    """As few settings as it takes, the one that needs it least first, so that all of them have the reserve."""
    values = {margin.setting: margin.value for margin in found}
    raised: dict[str, float] = {}
    reached = [(margin.share, margin) for margin in found if margin.share is not None]
    for share, margin in sorted(reached, key=lambda item: item[0]):
        lowered = {name: value / RESERVE for name, value in (values | raised).items()}
        if not _false_alarms(logs, _with(start, lowered)):
            break
        if share * RESERVE > 1.0:
            raised[margin.setting] = math.ceil(margin.value * share * RESERVE * 100) / 100
    return raised


def _why(margin: Margin, raised: Mapping[str, float]) -> str:
    if margin.share is None:
        return f"as it was: these flights reach less than {SHARES[0]:g} of it"
    reached = f"{'more than ' if margin.share >= SHARES[-1] else ''}{margin.share:.2f} times "
    if margin.setting in raised:
        return f"{RESERVE:g} times the largest in these flights, which reach {reached}{margin.value:g}"
    others = f"; {', '.join(raised)} keeps them quiet" if raised else ""
    return f"as it was: these flights reach {reached}its value{others}"


def _averaging(logs: Sequence[Log], start: CompanionConfig) -> tuple[float, str]:
    known = [log.window_us for log in logs if log.window_us is not None]
    if not known:
        return start.estimate.imu_averaging_interval_s, "not told by these logs: 1 / IMU_INTEG_RATE"
    return math.ceil(max(known) / 100) / 1e4, "99 of 100 IMU samples hold this time or less"


def settings_text(settings: Mapping[str, Any], reasons: Reasons, source: str) -> str:
    """YAML with each reason above its number. What is JSON is YAML."""
    lines = [f"# Written by rebound tune from {source}.", "companion:"]
    for part, values in settings.items():
        if not isinstance(values, dict):
            lines.append(f"  {part}: {json.dumps(values)}")
            continue
        lines.append(f"  {part}:")
        for name, value in values.items():
            lines += [f"    # {reasons[part, name]}"] if (part, name) in reasons else []
            lines.append(f"    {name}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"
