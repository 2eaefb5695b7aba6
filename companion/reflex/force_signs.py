"""What the detector `fused` remembers between samples, and what the force of one sample shows beside it.

Thresholds depend on this vehicle's noise in its own flight (see `force_noise`).

A person's hand and a soft strike on a hovering vehicle differ in how the force begins. An arm takes 80 ms and more to
push; a hand that grips stops the small speed of a hover. An obstacle strikes with its own speed, and its force is there
from one sample to the next. So a force is observed for a moment, and is a strike as soon as it jumps.
"""

import math
from dataclasses import dataclass, field

from companion.messages import Vector3
from companion.motion.config import CURRENT_US
from companion.motion.vector import ZERO
from companion.reflex.config import CLEAR, JUMP, MEAN_MEMORY_S, SHAKING, FusedConfig
from companion.reflex.detector import DetectorState, Impact, ImpactKind, Phase
from companion.reflex.force_noise import ForceNoise
from companion.reflex.thrust import ThrustGain
from companion.reflex.velocity_jump import VelocityJump


@dataclass(slots=True)
class FusedState(DetectorState):
    """Changed in place by `FusedDetector.step`; methods only read it. Times: vehicle's boot clock; forces: body FRD,
    m/s^2.
    """

    floor: ForceNoise = field(default_factory=ForceNoise)
    thrust: ThrustGain = field(default_factory=ThrustGain)
    jump: VelocityJump = field(default_factory=lambda: VelocityJump(0))
    velocity_ned_m_s: Vector3 | None = None
    hovered_boot_us: int | None = None
    contact_began_boot_us: int = 0
    kind: ImpactKind = ImpactKind.UNKNOWN
    """Of the present contact, or the latest one."""
    observed: Impact | None = None
    """The first loud sample while it is observed whether that is a hand."""
    last_frd_m_s2: Vector3 = ZERO
    before_frd_m_s2: Vector3 = ZERO
    """Of the sample before the last."""
    before_boot_us: int = 0

    def side_threshold_m_s2(self, config: FusedConfig, rates_frd_rad_s: Vector3) -> float:
        """Horizontal threshold, m/s^2. On a turning vehicle drag changes direction faster than its mean follows."""
        speed_m_s = math.hypot(*self.velocity_ned_m_s or ZERO)
        turning_rad_s = sum(map(abs, rates_frd_rad_s))
        return self.threshold_m_s2 + config.drag_per_s * speed_m_s * min(2.0, MEAN_MEMORY_S * turning_rad_s)

    def vertical_threshold_m_s2(self, config: FusedConfig) -> float:
        """Vertical threshold, m/s^2, beyond the force that propellers can make."""
        return max(config.vertical_threshold_m_s2, config.noise_factor * self.floor.vertical_m_s2)

    def side_force(self, config: FusedConfig, force_frd_m_s2: Vector3) -> tuple[float, float, bool]:
        """Horizontal force, m/s^2; how many thresholds are a hit; whether it is that of two samples together.

        Of one sample, or of two on a vehicle that vibrates until a contact has begun: what is nearer to a hit. Within a
        contact each sample speaks for itself: the one after a forged sample does not confirm it.
        """
        alone = math.dist(force_frd_m_s2[:2], self.floor.mean_frd_m_s2[:2])
        if self.phase is not Phase.ARMED or self.threshold_m_s2 <= SHAKING * config.side_threshold_m_s2:
            return alone, 1.0, False
        together = self._together_m_s2(force_frd_m_s2)
        return (together, 1.0, True) if together > alone / CLEAR else (alone, CLEAR, False)

    def _together_m_s2(self, force_frd_m_s2: Vector3) -> float:
        """Horizontal force of a sample and the one before it, as of one: their sum over the root of two, by which the
        noise of a sum grows. Vibration alternates, a contact does not.

        Compared with zero, too: a slow swing that the mean has not followed is none.
        """
        (f_x, f_y, _), (g_x, g_y, _), (m_x, m_y, _) = force_frd_m_s2, self.last_frd_m_s2, self.floor.mean_frd_m_s2
        x, y = f_x + g_x, f_y + g_y
        return math.sqrt(0.5) * min(math.hypot(x - 2.0 * m_x, y - 2.0 * m_y), math.hypot(x, y))

    @property
    def is_hand(self) -> bool:
        """Whether the present contact, or the latest one, was taken for a hand."""
        return self.kind is ImpactKind.CONTACT

    def may_be_hand(self, time_us: int) -> bool:
        """Whether the vehicle hovers, or just did: pushed by a hand with 2 m/s^2 it soon moves."""
        return self.hovered_boot_us is not None and time_us - self.hovered_boot_us < CURRENT_US

    def jumps(self, force_frd_m_s2: Vector3) -> bool:
        """Whether the force changed over one sample, or over two, by more than a hand's does."""
        least_m_s2 = JUMP * self.threshold_m_s2
        return any(math.dist(force_frd_m_s2, f) >= least_m_s2 for f in (self.last_frd_m_s2, self.before_frd_m_s2))
