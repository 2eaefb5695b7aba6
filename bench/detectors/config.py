"""A companion's settings, and a mission, in which a baseline can be chosen as the drone's own detector is."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from bench.detectors.contact import Threshold
from bench.detectors.force import FuzzyDetector, LateralDetector, ThresholdDetector
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from companion.reflex.detection.detector import Detector

BASELINES = (FuzzyDetector, LateralDetector, ThresholdDetector)


class BaselineConfig(CompanionConfig):
    """All settings of the companion, and those of each baseline under its name."""

    retired = frozenset[str]()

    detectors: ClassVar[Mapping[str, Callable[[Any, int], Detector]]] = {
        **CompanionConfig.detectors,
        **{baseline.name: baseline for baseline in BASELINES},
    }
    # As in its authors' program.
    fuzzy: Threshold = Threshold(threshold_m_s2=9.81)
    # Above the noise of a quiet vehicle: the simulated HIGHRES_IMU's 0.25 m/s^2 RMS per axis stays below 1.5 at
    # six sigma, and drag changes by less than 1.1 within the mean's memory. Below the signal: eq. 2 begins with
    # b_s * v_c = 30 m/s^2 at 1 m/s, of which a 4 ms mean that saw the last millisecond shows 7.5.
    lateral: Threshold = Threshold(threshold_m_s2=4.0)
    # As in its authors' program.
    threshold: Threshold = Threshold(threshold_m_s2=20.0)


class BaselineMission(Mission):
    """A mission that any of them may fly."""

    companion: BaselineConfig = BaselineConfig()
