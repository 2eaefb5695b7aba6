"""Detector `threshold`: a fixed magnitude over a window of samples, the rule in public use; here as the baseline.

Source: R. Wang et al., "Air Bumper: A Collision Detection and Reaction Framework for Autonomous MAV Navigation"
(arXiv 2307.06101): the accelerometer's magnitude, gravity taken off, over a window of samples against a fixed
20 m/s^2. Here the mean over ten samples must reach it:

    1/n sum |f_k - f_hover| >= 20 m/s^2,    f_hover = (0, 0, -g)
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from pydantic import Field

from companion.detection.contact import judge
from companion.detection.interface import DetectorState, Impact, Situation
from companion.estimate.strapdown import GRAVITY_M_S2
from companion.messages import ImuSample, MessageId, Sample, Vector3
from companion.written import Positive, Written


class ThresholdConfig(Written):
    """Settings of the detector `threshold`, as published."""

    threshold_m_s2: Positive = 20.0
    window: Annotated[int, Field(strict=True, ge=1, le=100)] = 10


@dataclass(slots=True)
class ThresholdState(DetectorState):
    """Adds the window: times, and forces without gravity (body FRD, m/s^2)."""

    times_us: deque[int] = field(default_factory=deque)
    forces: deque[Vector3] = field(default_factory=deque)
    sizes: deque[float] = field(default_factory=deque)


class ThresholdDetector:
    """See the module's text."""

    name = "threshold"
    losses: ClassVar[Mapping[MessageId, str]] = {}

    def __init__(self, config: ThresholdConfig, averaging_interval_us: int) -> None:
        self._config = config
        self._averaging_us = averaging_interval_us

    def initial(self) -> ThresholdState:
        return ThresholdState(threshold_m_s2=self._config.threshold_m_s2)

    def step(self, state: ThresholdState, sample: Sample, situation: Situation) -> tuple[ThresholdState, Impact | None]:
        if not isinstance(sample, ImuSample):
            return state, None
        f_x, f_y, f_z = sample.specific_force_frd_m_s2
        f_z += GRAVITY_M_S2
        state.times_us.append(sample.time_boot_us)
        state.forces.append((f_x, f_y, f_z))
        state.sizes.append(math.sqrt(f_x * f_x + f_y * f_y + f_z * f_z))
        if len(state.sizes) > self._config.window:
            state.times_us.popleft()
            state.forces.popleft()
            state.sizes.popleft()
        size = sum(state.sizes) / len(state.sizes)
        is_loud = len(state.sizes) == self._config.window and size >= self._config.threshold_m_s2
        free_until_us = state.times_us[0] - self._averaging_us
        force = max(state.forces, key=_square) if is_loud else (0.0, 0.0, 0.0)
        off = situation.off_reason
        return state, judge(state, sample.time_boot_us, free_until_us, force, max(state.sizes), is_loud, off)


def _square(force: Vector3) -> float:
    return force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
