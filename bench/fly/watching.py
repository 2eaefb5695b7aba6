"""Detectors by name let loose on what was heard."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from bench.detectors.config import BaselineConfig
from bench.fly.wire import BUILDERS, HeardStep
from companion.link.streams import wanted_streams
from companion.messages import MessageId
from companion.mission.config import CompanionConfig
from companion.reflex.detector import Situation
from companion.reflex.impact import ImpactEstimate
from companion.reflex.monitor import advance, start_monitor

# HIGHRES_IMU asked for, and what a client of PX4 receives of it.
ASKED_HZ = {50: 50.0, 100: 100.0, 246: 250.0}

DEFAULTS: Mapping[str, Any] = MappingProxyType({})
FLOWN_WITH = (BaselineConfig().detector,)
"""The detector of a drone."""

# A hit that is reported no later than this after its first touch has been found.
FOUND_WITHIN_US = 400_000

# What a detector's sensitivity hangs on is taken times these.
SWEPT_FACTORS = (0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0)
# Its settings; of detectors that are not here it is the first of their settings.
SWEPT_FIELDS = {
    "hybrid": ("threshold_m_s2", "torque_threshold_rad_s2"),
    "lateral": ("threshold_m_s2", "noise_factor"),
    "fused": (
        "side_threshold_m_s2",
        "vertical_threshold_m_s2",
        "noise_factor",
        "velocity_step_m_s",
        "rate_step_rad_s",
    ),
}


@dataclass(slots=True)
class Found:
    """A reported collision: when its sample was heard, its estimate then, and the final one if there was one."""

    time_boot_us: int
    first: ImpactEstimate
    final: ImpactEstimate


def configuration(detector: str, settings: Mapping[str, Any] = DEFAULTS, factor: float = 1.0) -> BaselineConfig:
    """The vehicle's settings with the detector's name, and its thresholds times `factor`."""
    if factor == 1.0:
        return BaselineConfig.model_validate({**settings, "detector": detector})
    config = configuration(detector, settings)
    own = getattr(config, detector)
    changes = {name: factor * getattr(own, name) for name in swept_fields(detector)}
    swept = type(own).model_validate({**own.model_dump(), **changes})
    return config.model_copy(update={detector: swept})


def swept_fields(detector: str) -> tuple[str, ...]:
    """Names of the settings that are swept together."""
    fields: dict[str, object] = type(getattr(BaselineConfig(), detector)).model_fields
    return SWEPT_FIELDS.get(detector, (next(iter(fields)),))


def detector_names() -> tuple[str, ...]:
    return tuple(BaselineConfig.detectors)


def streams_asked_hz(rate: int) -> dict[MessageId, float]:
    """What is asked of the vehicle for all detectors together, HIGHRES_IMU at the rate."""
    config = CompanionConfig().streams
    asked = {stream.message_id: stream.asked_hz for stream in wanted_streams(config, tuple(MessageId))}
    wanted = {message: hz for message, hz in asked.items() if message in BUILDERS}
    return {**wanted, MessageId.HIGHRES_IMU: ASKED_HZ[rate]}


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
