"""Detectors by name."""

from collections.abc import Callable, Container
from typing import Any

from companion.detection.fused import FusedDetector
from companion.detection.fuzzy import FuzzyDetector
from companion.detection.hybrid import HybridDetector
from companion.detection.interface import Detector
from companion.detection.lateral import LateralDetector
from companion.detection.momentum import MomentumDetector
from companion.detection.threshold import ThresholdDetector
from companion.detection.tracking import TrackingDetector

# name -> maker from the detector's own settings and the IMU's averaging interval in microseconds
DETECTORS: dict[str, Callable[[Any, int], Detector[Any]]] = {
    FusedDetector.name: FusedDetector,
    FuzzyDetector.name: FuzzyDetector,
    HybridDetector.name: HybridDetector,
    LateralDetector.name: LateralDetector,
    MomentumDetector.name: MomentumDetector,
    ThresholdDetector.name: ThresholdDetector,
    TrackingDetector.name: TrackingDetector,
}


def check_known_detector(name: str, known: Container[str]) -> None:
    """Raise ValueError, naming the choices, for a detector that does not exist."""
    if name not in known:
        raise ValueError(f"there is no detector '{name}'; the detectors are: {', '.join(sorted(DETECTORS))}")
