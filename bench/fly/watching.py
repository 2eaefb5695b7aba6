"""Detectors by name let loose on what was heard."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.detectors.config import BaselineConfig
from bench.fly.wire import HeardStep
from companion.link.streams import wanted_streams
from companion.messages import MessageId
from companion.mission.config import CompanionConfig
from companion.reflex.detector import Situation
from companion.reflex.impact import ImpactEstimate
from companion.reflex.monitor import advance, start_monitor

# HIGHRES_IMU asked for, and what a client of PX4 receives of it.
ASKED_HZ = {50: 50.0, 100: 100.0, 246: 250.0}

FLOWN_WITH = BaselineConfig().detector
"""The detector of a drone."""

# A hit that is reported no later than this after its first touch has been found.
FOUND_WITHIN_US = 400_000


@dataclass(slots=True)
class Found:
    """A reported collision: when its sample was heard, its estimate then, and the final one if there was one."""

    time_boot_us: int
    first: ImpactEstimate
    final: ImpactEstimate


def configuration(detector: str, settings: Mapping[str, Any]) -> BaselineConfig:
    """The vehicle's settings with the detector's name."""
    return BaselineConfig.model_validate({**settings, "detector": detector})


def streams_asked_hz(rate: int) -> dict[MessageId, float]:
    """What is asked of the plant for all detectors together, HIGHRES_IMU at the rate. It has no modes."""
    wanted = wanted_streams(CompanionConfig().streams, tuple(MessageId))
    asked_hz: dict[MessageId, float] = {stream.message_id: stream.asked_hz for stream in wanted}
    del asked_hz[MessageId.CURRENT_MODE]
    return asked_hz | {MessageId.HIGHRES_IMU: ASKED_HZ[rate]}


def watch_all(
    config: CompanionConfig, heard: Sequence[HeardStep], situations: Sequence[Situation]
) -> tuple[list[Found], list[ImpactEstimate], int]:
    """Collisions reported, touches that were reported as none, and how often the detector said it was blind."""
    monitor = start_monitor(config, heard[0].time_boot_us)
    found: list[Found] = []
    touches: list[ImpactEstimate] = []
    blind = 0
    for step in heard:
        seen = advance(monitor, step.samples, situations[step.index], step.time_boot_us)
        for estimate in seen.impacts:
            if estimate.impact.is_collision:
                found.append(Found(step.time_boot_us, estimate, estimate))
            else:
                touches.append(estimate)
        for final in seen.finished:
            for entry in found:
                if entry.first.impact is final.impact:
                    entry.final = final
        blind += sum("blind" in notice.text for notice in seen.notices)
    if found and monitor.estimator.estimate is not None and monitor.estimator.estimate.impact is found[-1].first.impact:
        found[-1].final = monitor.estimator.estimate
    return found, touches, blind
