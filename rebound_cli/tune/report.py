"""What healthy flights say of a vehicle and its detector, in words and as data."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rebound_cli.logs.log import Log
from rebound_cli.logs.shaking import Shaking, Stage, clipped
from rebound_cli.replay.findings import Findings
from rebound_cli.tune.hits import SPEEDS_M_S, Sight
from rebound_cli.tune.margins import LEAST_SHARE, Margin
from rebound_cli.tune.settings import Advice

SCHEMA = 1

_WIDTH = 110


@dataclass(frozen=True, slots=True)
class Healthy:
    """A flight without a collision, and what the detector made of it."""

    log: Log
    shaking: Shaking
    findings: Findings

    @property
    def in_air_s(self) -> float:
        flying = [stage is not Stage.GROUND for stage in self.shaking.stages]
        return float(np.sum(flying)) * self.shaking.interval_us * 1e-6


@dataclass(frozen=True, slots=True)
class Tuning:
    """All that was worked out."""

    detector: str
    flights: Sequence[Healthy]
    margins: Sequence[Margin]
    sights: Sequence[Sight]
    advice: Advice


def tuning_text(tuning: Tuning) -> str:
    parts = [_flight_text(flight) for flight in tuning.flights]
    parts.append(_margins_text(tuning))
    parts.append(_sights_text(tuning))
    return "\n\n".join(parts) + "\n"


def _flight_text(flight: Healthy) -> str:
    log, found = flight.log, flight.findings
    rows = [
        f"{log.path}: {log.vehicle}, {flight.in_air_s:.0f} s in the air, IMU at {flight.shaking.rate_hz:.0f} Hz",
        f"  {'':<16}{'noise x, y, z, RMS':<26}{'largest departure sideways, along z':<36}[m/s^2]",
    ]
    for stage, noise in flight.shaking.noise_m_s2().items():
        side, along = _largest(flight.shaking, stage)
        values = ", ".join(f"{value:.2f}" for value in noise)
        rows.append(f"  {stage.value:<16}{values:<26}{side:.1f}, {along:.1f}")
    count, how = clipped(log)
    rows.append(f"  clipping: {count or 'no'} sample{'' if count == 1 else 's'} ({how})")
    blind_s = sum(span.duration_s for span in found.blind)
    blind = f"blind for {blind_s:.2f} s, first: {found.blind[0].reason}" if found.blind else "never blind"
    rows.append(f"  as set now: {_alarms(found)}, {blind}")
    rows.extend(f"  note: {loss}" for loss in log.losses)
    return "\n".join(textwrap.fill(row, _WIDTH, subsequent_indent="    ") if len(row) > _WIDTH else row for row in rows)


def _alarms(found: Findings) -> str:
    count = len(found.collisions)
    return "no false alarm" if count == 0 else f"{count} false alarm{'' if count == 1 else 's'}"


def _largest(shaking: Shaking, stage: Stage) -> tuple[float, float]:
    departures = shaking.during(stage)
    return float(np.hypot(departures[:, 0], departures[:, 1]).max()), float(np.abs(departures[:, 2]).max())


def _margins_text(tuning: Tuning) -> str:
    rows = [f"detector '{tuning.detector}': the largest sign of a hit in these flights, as a share of each threshold"]
    for margin in tuning.margins:
        share = f"below {LEAST_SHARE:g}" if margin.share is None else f"{margin.share:.2f}"
        alarm = "   a false alarm" if margin.share is not None and margin.share >= 1.0 else ""
        rows.append(f"  {margin.setting:<28}{margin.value:<10g}{share}{alarm}")
    left = tuning.advice.false_alarms_left
    if left:
        rows.append(
            f"  with the settings below still {left} false alarms: this vehicle is not made quiet by thresholds"
        )
    return "\n".join(rows)


def _sights_text(tuning: Tuning) -> str:
    first = tuning.sights[0]
    speeds = "".join(f"{speed:>6g}" for speed in SPEEDS_M_S)
    rows = [
        f"hits put into these flights, seen of {first.hits}, by speed in m/s (eq. 2, head-on, by force alone)",
        f"  {'':<24}{speeds}   all seen from",
    ]
    for one in tuning.sights:
        counts = "".join(f"{count:>6}" for count in one.seen)
        certain = one.certain_from_m_s
        text = "no speed tried" if certain is None else f"{certain:g} m/s on"
        rows.append(f"  {one.airframe + f', {one.rate_hz:.0f} Hz':<24}{counts}   {text}")
    return "\n".join(rows)


def tuning_data(tuning: Tuning) -> dict[str, Any]:
    """The same for a program; SI units, body FRD."""
    return {
        "schema": SCHEMA,
        "detector": tuning.detector,
        "flights": [_flight_data(flight) for flight in tuning.flights],
        "margins": [
            {"setting": margin.setting, "value": margin.value, "share": margin.share} for margin in tuning.margins
        ],
        "hits": [
            {
                "airframe": one.airframe,
                "rate_hz": round(one.rate_hz, 2),
                "hits": one.hits,
                "speeds_m_s": list(SPEEDS_M_S),
                "seen": list(one.seen),
                "all_seen_from_m_s": one.certain_from_m_s,
            }
            for one in tuning.sights
        ],
        "settings": [
            {"place": ".".join(("companion", *place)), "value": value, "reason": tuning.advice.reasons.get(place)}
            for place, value in tuning.advice.values.items()
        ],
        "false_alarms_left": tuning.advice.false_alarms_left,
    }


def _flight_data(flight: Healthy) -> dict[str, Any]:
    count, how = clipped(flight.log)
    return {
        "log": str(flight.log.path),
        "vehicle": flight.log.vehicle,
        "in_air_s": round(flight.in_air_s, 2),
        "imu_rate_hz": round(flight.shaking.rate_hz, 2),
        "noise_rms_frd_m_s2": {
            stage.value: [round(float(value), 3) for value in noise]
            for stage, noise in flight.shaking.noise_m_s2().items()
        },
        "clipped_samples": count,
        "clipping_known_by": how,
        "false_alarms": len(flight.findings.collisions),
        "blind_s": round(sum(span.duration_s for span in flight.findings.blind), 3),
        "notes": list(flight.log.losses),
    }
