"""All that the detector `fused` remembers between samples."""

from dataclasses import dataclass, field

from companion.detection.force_noise import ForceNoise
from companion.detection.interface import DetectorState
from companion.detection.thrust import ThrustGain
from companion.detection.velocity_jump import VelocityJump
from companion.messages import Vector3
from companion.motion.strapdown import ZERO


@dataclass(slots=True)
class FusedState(DetectorState):
    """Changed in place by `FusedDetector.step`. Times: vehicle's boot clock; forces: body FRD, m/s^2."""

    floor: ForceNoise = field(default_factory=ForceNoise)
    thrust: ThrustGain = field(default_factory=ThrustGain)
    jump: VelocityJump = field(default_factory=lambda: VelocityJump(0))
    velocity_ned_m_s: Vector3 | None = None
    hovered_boot_us: int | None = None
    contact_began_boot_us: int = 0
    is_hand: bool = False
    """Whether the present contact, or the latest one, was taken for a hand."""
    loud_since_boot_us: int | None = None
    """Time of the first loud sample while it is observed whether that is a hand."""
    free_until_boot_us: int = 0
    """The latest time without that force."""
    last_frd_m_s2: Vector3 = ZERO
    before_frd_m_s2: Vector3 = ZERO
    """Of the sample before the last."""
    before_boot_us: int = 0
