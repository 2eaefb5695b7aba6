"""How near a healthy flight comes to each threshold: by lowering it until the detector takes the flight for a hit.

The detector itself is run, so the figure holds for whatever it compares: a threshold is met at the share of it that
the flight's largest sign of a hit reaches.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log
from rebound_cli.replay.watching import watch_log

# What settings of a detector are compared with the flight, by the words in their names.
_COMPARED = re.compile(r"threshold|factor|step")
# Below this share a setting is far from mattering; above the upper one the vehicle needs another detector.
LEAST_SHARE, MOST_SHARE = 0.4, 4.0
# Shares are found to this: finer than flights differ from each other.
SHARE_STEP = 0.02


@dataclass(frozen=True, slots=True)
class Margin:
    """`share`: the largest sign of a hit over the threshold; None below LEAST_SHARE. Above 1 it is a false alarm."""

    setting: str
    value: float
    share: float | None


def compared_settings(config: CompanionConfig) -> dict[str, float]:
    """Names and values of the detector's thresholds."""
    settings = getattr(config, config.detector).model_dump()
    return {
        name: float(value) for name, value in settings.items() if isinstance(value, float) and _COMPARED.search(name)
    }


def margins(logs: Sequence[Log], config: CompanionConfig) -> Iterator[Margin]:
    """Of each threshold alone, over all flights together."""
    for name, value in compared_settings(config).items():
        yield Margin(name, value, _share(logs, config, name, value))


def with_setting(config: CompanionConfig, name: str, value: float) -> CompanionConfig:
    """The same but for one setting of the detector."""
    settings = getattr(config, config.detector).model_copy(update={name: value})
    return config.model_copy(update={config.detector: settings})


def false_alarms(logs: Sequence[Log], config: CompanionConfig) -> int:
    """Collisions found in flights that had none."""
    return sum(len(watch_log(log, config).collisions) for log in logs)


def _share(logs: Sequence[Log], config: CompanionConfig, name: str, value: float) -> float | None:
    def fires(share: float) -> bool:
        changed = with_setting(config, name, share * value)
        return any(watch_log(log, changed).collisions for log in logs)

    low, high = LEAST_SHARE, 1.0
    if not fires(low):
        return None
    while fires(high):
        if high >= MOST_SHARE:
            return high
        low, high = high, min(2.0 * high, MOST_SHARE)
    while high - low > SHARE_STEP:
        middle = (low + high) / 2
        low, high = (middle, high) if fires(middle) else (low, middle)
    return high
