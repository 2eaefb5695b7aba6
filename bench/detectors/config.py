"""A companion's settings, and a mission, in which a baseline can be chosen as the drone's own detector is."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from bench.detectors.fuzzy import FuzzyConfig, FuzzyDetector
from bench.detectors.hybrid import HybridConfig, HybridDetector
from bench.detectors.lateral import LateralConfig, LateralDetector
from bench.detectors.momentum import MomentumConfig, MomentumDetector
from bench.detectors.threshold import ThresholdConfig, ThresholdDetector
from bench.detectors.tracking import TrackingConfig, TrackingDetector
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from companion.reflex.detector import Detector


class BaselineConfig(CompanionConfig):
    """All settings of the companion, and those of each baseline under its name."""

    retired = frozenset[str]()

    detectors: ClassVar[Mapping[str, Callable[[Any, int], Detector[Any]]]] = {
        **CompanionConfig.detectors,
        FuzzyDetector.name: FuzzyDetector,
        HybridDetector.name: HybridDetector,
        LateralDetector.name: LateralDetector,
        MomentumDetector.name: MomentumDetector,
        ThresholdDetector.name: ThresholdDetector,
        TrackingDetector.name: TrackingDetector,
    }
    fuzzy: FuzzyConfig = FuzzyConfig()
    hybrid: HybridConfig = HybridConfig()
    lateral: LateralConfig = LateralConfig()
    momentum: MomentumConfig = MomentumConfig()
    threshold: ThresholdConfig = ThresholdConfig()
    tracking: TrackingConfig = TrackingConfig()


class BaselineMission(Mission):
    """A mission that any of them may fly."""

    companion: BaselineConfig = BaselineConfig()
