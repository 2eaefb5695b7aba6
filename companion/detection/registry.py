"""Detectors by name."""

from collections.abc import Callable, Container
from typing import Any, TypeAlias

from companion.detection.fused import FusedDetector
from companion.detection.interface import Detector

MakeDetector: TypeAlias = Callable[[Any, int], Detector[Any]]
"""From the detector's own settings and the IMU's averaging interval in microseconds."""

DETECTORS: dict[str, MakeDetector] = {FusedDetector.name: FusedDetector}

BASELINES = frozenset({"fuzzy", "hybrid", "lateral", "momentum", "threshold", "tracking"})
"""Detectors that a drone once had beside its own, and that its settings may still name."""


def check_known_detector(name: str, known: Container[str]) -> None:
    """Raise ValueError, naming the choices, for a detector that does not exist."""
    if name in known:
        return
    choices = " or ".join(f"'{detector}'" for detector in sorted(DETECTORS))
    if name in BASELINES:
        where = "`python -m bench detectors`, run in a checkout of Rebound"
        raise ValueError(f"the detector '{name}' is a baseline of {where}, now; a drone flies with {choices}")
    raise ValueError(f"there is no detector '{name}'; a drone flies with {choices}")
