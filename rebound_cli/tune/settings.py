"""The settings to fly with, each with its reason, as a file that `rebound fly --companion` reads.

How near a healthy flight comes to a threshold is found by lowering it until the detector, run itself, takes the flight
for a hit: a threshold is met at the share of it that the flight's largest sign of a hit reaches.
"""

import json
import math
import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log
from rebound_cli.replay.watching import watch_log

# What settings of a detector are compared with the flight, by the words in their names.
_COMPARED = re.compile(r"threshold|factor|step")
# Below the first share a setting is far from mattering; above the last one the vehicle needs another detector. Two
# flights differ from each other by more than a step.
SHARES = [round(0.4 + 0.02 * step, 2) for step in range(181)]
# Other days have other gusts: a threshold stands at least this many times above the largest of these flights.
RESERVE = 1.25

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Margin:
    """`share`: the largest sign of a hit over the threshold; None below SHARES. Above 1 it is a false alarm."""

    setting: str
    value: float
    share: float | None


@dataclass(frozen=True, slots=True)
class Advice:
    """Each value, and the reason for it if there is one, by its place below `companion:`; `config` is the whole."""

    config: CompanionConfig
    settings: Mapping[Path, tuple[Any, str | None]]
    false_alarms_left: int


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


def advise(logs: Sequence[Log], start: CompanionConfig, found: Sequence[Margin]) -> Advice:
    """Thresholds with a reserve over these flights, never below where they started."""
    raised = _raised(logs, start, found)
    given = _leaves(start.model_dump(mode="json", exclude_unset=True))
    settings: dict[Path, tuple[Any, str | None]] = {("detector",): (start.detector, None)}
    settings |= {place: (value, None) for place, value in given}
    for margin in found:
        value = raised.get(margin.setting, margin.value)
        settings[start.detector, margin.setting] = value, _why(margin, raised)
    settings["estimate", "imu_averaging_interval_s"] = _averaging(logs, start)
    config = _with(start, raised)
    return Advice(config, settings, _false_alarms(logs, config))


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


def settings_text(advice: Advice, source: str) -> str:
    """YAML with each reason above its number."""
    lines = [f"# Written by rebound tune from {source}.", "companion:"]
    for part in dict.fromkeys(place[0] for place in advice.settings):
        if (part,) not in advice.settings:
            lines.append(f"  {part}:")
        for place, (value, reason) in advice.settings.items():
            if place[0] == part:
                indent = "  " * len(place[:2])
                lines += [f"{indent}# {reason}"] if reason else []
                lines.append(f"{indent}{'.'.join(place[1:]) or part}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def _leaves(data: Mapping[str, Any], place: Path = ()) -> Iterator[tuple[Path, Any]]:
    for name, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*place, name))
        else:
            yield (*place, name), value
