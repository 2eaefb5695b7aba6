"""`rebound tune`: from healthy flights to what a detector can see on this vehicle, and the settings to fly with."""

import json
import math
import textwrap
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from companion.messages import Attitude, Heartbeat, ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.documents import parse_document, refuse_existing, validated, write_text
from rebound_cli.inputs import companion_settings
from rebound_cli.live.console import console_for
from rebound_cli.logs.log import Log, LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.logs.shaking import FLYING, Stage, clipped
from rebound_cli.replay.recording import log_file
from rebound_cli.replay.report import Replay, replay_log
from rebound_cli.results.run_folder import read_summary
from rebound_cli.tune.settings import SHARES, Advice, Margin, advise, margins, settings_text

SCHEMA = 2

_WIDTH = 110
# PX4's failure detector takes a larger tilt for a lost attitude: FD_FAIL_R and FD_FAIL_P, 60 deg by default.
_TILT_DEG = 60.0
# PX4's land detector takes less force, for so long, for a fall: LNDMC_FFALL_THR and LNDMC_FFALL_TTRI.
_FALL_M_S2 = 2.0
_FALL_US = 300_000
# The detector learns its floor in half a second (`shaking.MEMORY_US`): six times that show how it varies.
_LEAST_FLYING_S = 3.0


def run_tune(options: Namespace) -> int:
    """Print what the flights say and the settings; with --out write these. Raises LogError, ConfigurationError."""
    console, out = console_for(options.json), options.out
    refuse_existing(out)
    config = companion_settings(options.companion, (), options.detector)
    flights = [read_healthy(path, config) for path in options.logs]
    logs = [flight.log for flight in flights]
    found = margins(logs, config)
    advice = advise(logs, config, found)
    text = settings_text(advice, ", ".join(path.name for path in options.logs))
    # Read as `rebound fly` will read it before anybody has it.
    document = parse_document(text, str(out or "the settings"))
    validated(CompanionConfig, document, document.data["companion"], ("companion",))
    if options.json:
        print(json.dumps(tuning_data(flights, found, advice), indent=2))
    else:
        parts = [*map(_flight_rows, flights), _margin_rows(found, advice)]
        console.print("\n\n".join("\n".join(part) for part in parts) + "\n")
        console.print(text.rstrip())
    if out is not None:
        write_text(out, text)
        console.print(f"\nWritten to {out}. Fly with it: rebound fly MISSION --companion {out} ...")
    return 0


def read_healthy(path: Path, config: CompanionConfig) -> Replay:
    """A flight without a collision, and what the detector made of it.

    Raises LogError for a log that cannot be read, and for a flight that teaches nothing or the wrong thing.
    """
    log = read_log(log_file(path))
    hits = len((read_summary(path) or {}).get("collisions", ()))
    wrong = f"its summary tells {hits} collision{'' if hits == 1 else 's'}" if hits else crash(log)
    if wrong is not None:
        raise LogError(f"{path}: not a healthy flight, {wrong}; tune learns from flights without a hit or a crash.")
    flight = replay_log(log, config, None)
    flying_s = flight.shaking.lasted_s(*FLYING)
    if not flying_s:
        raise LogError(f"{path}: no flight in it, only the ground, a take-off and a landing.")
    if flying_s < _LEAST_FLYING_S:
        raise LogError(f"{path}: too short a flight to learn from; a minute in the air is a good one.")
    return flight


def crash(log: Log) -> str | None:
    """What speaks against a healthy flight: armed, it tipped over or fell. None where nothing does."""
    armed, falls_from_us = False, None
    for heard in log.heard:
        match heard.sample:
            case Heartbeat(armed=armed):
                pass
            case Attitude(attitude_wxyz=(_, x, y, _)) if armed:
                tilt_deg = math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
                if tilt_deg > _TILT_DEG:
                    return f"it tipped to {tilt_deg:.0f} degrees at {log.seconds(heard.at_us):.1f} s"
            case ImuSample(specific_force_frd_m_s2=force):
                if not armed or math.hypot(*force) > _FALL_M_S2:
                    falls_from_us = None
                    continue
                falls_from_us = heard.at_us if falls_from_us is None else falls_from_us
                if heard.at_us - falls_from_us >= _FALL_US:
                    return f"it fell at {log.seconds(falls_from_us):.1f} s"
    return None


def _in_air_s(flight: Replay) -> float:
    return flight.shaking.lasted_s(*(stage for stage in Stage if stage is not Stage.GROUND))


def _flight_rows(flight: Replay) -> Iterator[str]:
    log, found, shaking = flight.log, flight.findings, flight.shaking
    rows = [
        f"{log.path}: {log.vehicle}, {_in_air_s(flight):.0f} s in the air, IMU at {shaking.rate_hz:.0f} Hz",
        f"  {'':<16}{'noise x, y, z, RMS':<26}{'largest departure sideways, along z':<36}[m/s^2]",
    ]
    for stage, noise in shaking.noise_m_s2().items():
        x, y, z = shaking.during(stage).T
        values = ", ".join(f"{value:.2f}" for value in noise)
        rows.append(f"  {stage.value:<16}{values:<26}{np.hypot(x, y).max():.1f}, {np.abs(z).max():.1f}")
    count, how = clipped(log)
    alarms, blind_s = len(found.collisions), sum(span.duration_s for span in found.blind)
    blind = f"blind for {blind_s:.2f} s, first: {found.blind[0].reason}" if found.blind else "never blind"
    rows += [
        f"  clipping: {count or 'no'} sample{'' if count == 1 else 's'} ({how})",
        f"  as set now: {alarms or 'no'} false alarm{'s' if alarms > 1 else ''}, {blind}",
        f"  smallest hit that shows: {found.promise.text() if found.promise else 'not known'}",
        *(f"  note: {loss}" for loss in log.losses),
    ]
    for row in rows:
        yield textwrap.fill(row, _WIDTH, subsequent_indent="    ") if len(row) > _WIDTH else row


def _margin_rows(found: Sequence[Margin], advice: Advice) -> Iterator[str]:
    title = "the largest sign of a hit in these flights, as a share of each threshold"
    yield f"detector '{advice.config.detector}': {title}"
    for margin in found:
        share = f"below {SHARES[0]:g}" if margin.share is None else f"{margin.share:.2f}"
        alarm = "   a false alarm" if (margin.share or 0.0) >= 1.0 else ""
        yield f"  {margin.setting:<28}{margin.value:<10g}{share}{alarm}"
    if left := advice.false_alarms_left:
        yield f"  with the settings below still {left} false alarms: this vehicle is not made quiet by thresholds"


def tuning_data(flights: Sequence[Replay], found: Sequence[Margin], advice: Advice) -> dict[str, Any]:
    """The same for a program; SI units, body FRD."""
    return {
        "schema": SCHEMA,
        "detector": advice.config.detector,
        "flights": [_flight_data(flight) for flight in flights],
        "margins": [asdict(margin) for margin in found],
        "settings": [
            {"place": ".".join(("companion", *place)), "value": value, "reason": reason}
            for place, (value, reason) in advice.settings.items()
        ],
        "false_alarms_left": advice.false_alarms_left,
    }


def _flight_data(flight: Replay) -> dict[str, Any]:
    count, how = clipped(flight.log)
    return {
        "log": str(flight.log.path),
        "vehicle": flight.log.vehicle,
        "in_air_s": round(_in_air_s(flight), 2),
        "imu_rate_hz": round(flight.shaking.rate_hz, 2),
        "noise_rms_frd_m_s2": flight.shaking.noise_data(),
        "clipped_samples": count,
        "clipping_known_by": how,
        "false_alarms": len(flight.findings.collisions),
        "promise": flight.findings.promise and flight.findings.promise.summary(),
        "blind_s": round(sum(span.duration_s for span in flight.findings.blind), 3),
        "notes": list(flight.log.losses),
    }
