"""The settings to fly with, each with its reason, as a file that `rebound fly --companion` reads."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log
from rebound_cli.tune.hits import Sight
from rebound_cli.tune.margins import LEAST_SHARE, MOST_SHARE, Margin, false_alarms, with_setting

# Other days have other gusts: a threshold stands at least this many times above the largest of these flights.
RESERVE = 1.25
# The rate below which a flight must not begin is that at which every hit from this speed on was seen.
WANTED_M_S = 1.0
# A rate asked for is received to within a tenth.
RECEIVED_SHARE = 0.9

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Advice:
    """`values` and `reasons` by their place below `companion:`; `config` is the whole."""

    config: CompanionConfig
    values: Mapping[Path, Any]
    reasons: Mapping[Path, str]
    false_alarms_left: int


def advise(logs: Sequence[Log], start: CompanionConfig, found: Sequence[Margin], sights: Sequence[Sight]) -> Advice:
    """Thresholds with a reserve over these flights, never below where they started."""
    raised, config = _raised(logs, start, found)
    values: dict[Path, Any] = {("detector",): start.detector, **dict(_given(start))}
    reasons: dict[Path, str] = {}
    for margin in found:
        place = (start.detector, margin.setting)
        values[place] = raised.get(margin.setting, margin.value)
        reasons[place] = _why(margin, raised)
    _advise_averaging(logs, start, values, reasons)
    _advise_rate(sights, start, values, reasons)
    return Advice(config, values, reasons, false_alarms(logs, config))


def _raised(
    logs: Sequence[Log], start: CompanionConfig, found: Sequence[Margin]
) -> tuple[dict[str, float], CompanionConfig]:
    """As few settings as it takes, the one that needs it least first, so that all of them have the reserve."""
    raised: dict[str, float] = {}
    config = start
    reached = [(margin.share, margin) for margin in found if margin.share is not None]
    for share, margin in sorted(reached, key=lambda item: item[0]):
        if not false_alarms(logs, _lowered(config, found, raised)):
            break
        if share * RESERVE > 1.0:
            raised[margin.setting] = math.ceil(margin.value * share * RESERVE * 100) / 100
            config = with_setting(config, margin.setting, raised[margin.setting])
    return raised, config


def _lowered(config: CompanionConfig, found: Sequence[Margin], raised: Mapping[str, float]) -> CompanionConfig:
    """All thresholds at once by the reserve."""
    for margin in found:
        config = with_setting(config, margin.setting, raised.get(margin.setting, margin.value) / RESERVE)
    return config


def _why(margin: Margin, raised: Mapping[str, float]) -> str:
    if margin.share is None:
        return f"as it was: these flights reach less than {LEAST_SHARE:g} of it"
    reached = f"{'more than ' if margin.share >= MOST_SHARE else ''}{margin.share:.2f} times "
    if margin.setting in raised:
        return f"{RESERVE:g} times the largest in these flights, which reach {reached}{margin.value:g}"
    others = f"; {', '.join(raised)} keeps them quiet" if raised else ""
    return f"as it was: these flights reach {reached}its value{others}"


def _advise_averaging(
    logs: Sequence[Log], start: CompanionConfig, values: dict[Path, Any], reasons: dict[Path, str]
) -> None:
    place = ("estimate", "imu_averaging_interval_s")
    known = [log.averaging_us for log in logs if log.averaging_us is not None]
    if known:
        values[place] = math.ceil(max(known) / 100) / 1e4
        reasons[place] = "99 of 100 IMU samples are means over this time or less"
    else:
        values[place] = start.estimate.imu_averaging_interval_s
        reasons[place] = "not told by these logs: 1 / IMU_INTEG_RATE"


def _advise_rate(
    sights: Sequence[Sight], start: CompanionConfig, values: dict[Path, Any], reasons: dict[Path, str]
) -> None:
    place, name = ("streams", "min_highres_imu_hz"), sights[0].airframe
    rates = [
        one.rate_hz
        for one in sights
        if one.airframe == name and one.certain_from_m_s is not None and one.certain_from_m_s <= WANTED_M_S
    ]
    if rates:
        values[place] = float(math.floor(RECEIVED_SHARE * min(rates)))
        reasons[place] = f"at {min(rates):.0f} Hz all hits from {WANTED_M_S:g} m/s on were seen ({name} arms)"
    else:
        values[place] = start.streams.min_highres_imu_hz
        reasons[place] = f"as it was: at no rate tried were all hits from {WANTED_M_S:g} m/s on seen ({name} arms)"


def settings_text(advice: Advice, source: str) -> str:
    """YAML with each reason above its number."""
    lines = [f"# Written by rebound tune from {source}.", "companion:"]
    parts: dict[str, list[Path]] = {}
    for place in advice.values:
        parts.setdefault(place[0], []).append(place)
    for name, places in parts.items():
        if places == [(name,)]:
            lines.append(f"  {name}: {_written(advice.values[(name,)])}")
            continue
        lines.append(f"  {name}:")
        for place in places:
            if place in advice.reasons:
                lines.append(f"    # {advice.reasons[place]}")
            lines.append(f"    {'.'.join(place[1:])}: {_written(advice.values[place])}")
    return "\n".join(lines) + "\n"


def _written(value: Any) -> str:
    return json.dumps(value)


def _given(config: CompanionConfig) -> Mapping[Path, Any]:
    """What the settings to begin with state themselves."""
    return dict(_leaves(config.model_dump(mode="json", exclude_unset=True), ()))


def _leaves(data: Mapping[str, Any], place: Path) -> Iterator[tuple[Path, Any]]:
    for name, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*place, name))
        else:
            yield (*place, name), value
