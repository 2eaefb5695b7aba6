"""Flights to learn from: settings learnt from a crash would be deaf to the next one."""

import json
import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.messages import Attitude, Heartbeat, ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log, LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.logs.shaking import FLYING, Shaking, Stage, shaking
from rebound_cli.replay.recording import is_run_folder
from rebound_cli.replay.watching import Findings, watch_log
from rebound_cli.run_folder import SUMMARY_NAME, TLOG_NAME
from rebound_cli.tune.hits import hit_moments

# PX4's failure detector takes a larger tilt for a lost attitude: FD_FAIL_R and FD_FAIL_P, 60 deg by default.
_TILT_DEG = 60.0
# PX4's land detector takes less force, for so long, for a fall: LNDMC_FFALL_THR and LNDMC_FFALL_TTRI.
_FALL_M_S2 = 2.0
_FALL_US = 300_000


@dataclass(frozen=True, slots=True)
class Healthy:
    """A flight without a collision, and what the detector made of it."""

    log: Log
    shaking: Shaking
    findings: Findings

    @property
    def in_air_s(self) -> float:
        return float(np.sum(self.shaking.stages != Stage.GROUND)) * self.shaking.interval_us * 1e-6


def read_healthy(path: Path, config: CompanionConfig) -> Healthy:
    """Raises LogError for a log that cannot be read, and for a flight that teaches nothing or the wrong thing."""
    log = read_log(path / TLOG_NAME if is_run_folder(path) else path)
    hits = _told_hits(path)
    wrong = f"its summary tells {hits} collision{'' if hits == 1 else 's'}" if hits else crash(log)
    if wrong is not None:
        raise LogError(f"{path}: not a healthy flight, {wrong}; tune learns from flights without a hit or a crash.")
    shakes = shaking(log)
    if not any(stage in FLYING for stage in shakes.stages):
        raise LogError(f"{path}: no flight in it, only the ground, a take-off and a landing.")
    if not any(hit_moments(log)):
        raise LogError(f"{path}: too short a flight to learn from; a minute in the air is a good one.")
    return Healthy(log, shakes, watch_log(log, config))


def _told_hits(folder: Path) -> int:
    """Collisions that the summary of our own flight tells; 0 where there is none to read."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return len(json.loads((folder / SUMMARY_NAME).read_text(encoding="utf-8"))["collisions"])
    return 0


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
