"""All that the detector `fused` remembers between samples."""

from dataclasses import dataclass, field

from companion.detection.aftermath import Aftermath
from companion.detection.floor import Floor
from companion.detection.interface import DetectorState
from companion.detection.soft import SoftTouch
from companion.detection.thrust import ThrustGain
from companion.messages import Vector3


@dataclass(slots=True)
class FusedState(DetectorState):
    """Changed in place by `FusedDetector.step`."""

    floor: Floor = field(default_factory=Floor)
    thrust: ThrustGain = field(default_factory=ThrustGain)
    aftermath: Aftermath = field(default_factory=lambda: Aftermath(0))
    velocity_ned_m_s: Vector3 | None = None
    odometry_boot_us: int | None = None
    reset_counter: int = 0
    contact_began_boot_us: int = 0
    hit_boot_us: int | None = None
    """Of the latest impact that was no hand's."""
    soft: SoftTouch = field(default_factory=SoftTouch)
