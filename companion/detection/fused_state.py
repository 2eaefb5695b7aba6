"""All that the detector `fused` remembers between samples."""

from dataclasses import dataclass, field

from companion.detection.force_noise import ForceNoise
from companion.detection.interface import DetectorState
from companion.detection.soft_contact import SoftContact
from companion.detection.thrust import ThrustGain
from companion.detection.velocity_jump import VelocityJump
from companion.messages import Vector3


@dataclass(slots=True)
class FusedState(DetectorState):
    """Changed in place by `FusedDetector.step`."""

    floor: ForceNoise = field(default_factory=ForceNoise)
    thrust: ThrustGain = field(default_factory=ThrustGain)
    jump: VelocityJump = field(default_factory=lambda: VelocityJump(0))
    velocity_ned_m_s: Vector3 | None = None
    contact_began_boot_us: int = 0
    soft: SoftContact = field(default_factory=SoftContact)
