"""What every baseline has: a loudness, a threshold, and one impact for one contact."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from companion.messages import (
    Attitude,
    ImuSample,
    MessageId,
    Quaternion,
    Sample,
    Vector3,
)
from companion.motion.strapdown import LEVEL
from companion.reflex.detection.classify import classified
from companion.reflex.detection.detector import DetectorState, Impact, ImpactKind, Motion, Phase, Situation
from companion.strict_model import Positive, StrictModel

# A contact lasts 20 to 120 ms with its sign present all through; this long without it, it is over.
REARM_US = 40_000


class Threshold(StrictModel):
    """The setting of a baseline: from how large a force on it is loud."""

    threshold_m_s2: Positive


@dataclass(slots=True)
class BaselineState(DetectorState):
    """Adds what the vehicle said last of its attitude; changed in place."""

    attitude_wxyz: Quaternion = LEVEL


class Reading(NamedTuple):
    """What a sample shows: a force, its size where forces are looked at, and until when there was surely no contact."""

    is_loud: bool
    force_frd_m_s2: Vector3
    size_m_s2: float
    free_until_us: int


class Baseline(ABC):
    """Built from its settings, as the drone's own detector is."""

    losses: ClassVar[Mapping[MessageId, str]] = {}
    state: ClassVar[type[BaselineState]] = BaselineState

    def __init__(self, config: Threshold, averaging_interval_us: int) -> None:
        self._least_m_s2 = config.threshold_m_s2
        self._averaging_us = averaging_interval_us

    def initial(self) -> Any:
        return self.state(threshold_m_s2=self._least_m_s2)

    def step(self, state: Any, sample: Sample, situation: Situation, motion: Motion) -> Impact | None:
        if isinstance(sample, Attitude):
            state.attitude_wxyz = sample.attitude_wxyz
        elif isinstance(sample, ImuSample):
            reading = self.look(state, sample, situation)
            if reading is not None:
                impact = judge(state, sample.time_boot_us, reading, situation.off_reason)
                # It does not classify, but for a landing: the ground is no hit.
                named = None if impact is None else classified(impact, None, situation, motion)
                return named if named is not None and named.kind is ImpactKind.LANDING else impact
        return None

    @abstractmethod
    def look(self, s: Any, sample: Any, situation: Situation) -> Reading | None:
        """What one of its samples shows; None where it cannot show anything yet."""

    def free_until_us(self, s: DetectorState, now_us: int) -> int:
        """Before the sample's averaging window, or the gap before it."""
        return min(now_us - self._averaging_us, s.last_sample_boot_us)


def judge(state: DetectorState, time_us: int, reading: Reading, off_reason: str | None) -> Impact | None:
    """Move the state's phase by one sample; the impact if it is the first loud one of a contact."""
    before, state.last_sample_boot_us = state.phase, time_us
    if off_reason is not None:
        state.phase, state.off_reason = Phase.OFF, off_reason
        return None
    state.off_reason = ""
    if not reading.is_loud:
        if before is Phase.OFF:
            state.phase, state.last_loud_boot_us = Phase.QUIET, time_us
        elif time_us - state.last_loud_boot_us >= REARM_US:
            state.phase = Phase.ARMED
        return None
    state.last_loud_boot_us = time_us
    if before is Phase.ARMED:
        state.phase = Phase.CONTACT
        state.peak_specific_force_m_s2 = reading.size_m_s2
        return Impact(time_us, reading.free_until_us, reading.force_frd_m_s2)
    if before is Phase.CONTACT:
        state.peak_specific_force_m_s2 = max(state.peak_specific_force_m_s2, reading.size_m_s2)
    else:
        state.phase = Phase.QUIET
    return None
