"""Range of the specific force on body z that the propellers can make: from zero to their maximum thrust."""

from dataclasses import dataclass

from companion.motion.config import CURRENT_US
from companion.reflex.config import GAIN_MEMORY_S, LEAST_FRACTION, MARGIN, STRONGEST_M_S2


@dataclass(slots=True)
class ThrustGain:
    """Specific force at full thrust, learnt as -f_z over the commanded thrust. Changed only by its methods."""

    fraction: float = 0.0
    fraction_boot_us: int = -CURRENT_US
    full_m_s2: float = 0.0
    known_s: float = 0.0

    def set_fraction(self, time_us: int, fraction: float) -> None:
        self.fraction, self.fraction_boot_us = fraction, time_us

    def is_commanded(self, time_us: int) -> bool:
        """Whether the commanded thrust is valid, and large enough for a quotient."""
        return self.fraction >= LEAST_FRACTION and time_us - self.fraction_boot_us <= CURRENT_US

    @property
    def is_known(self) -> bool:
        return self.known_s >= GAIN_MEMORY_S

    def learn(self, time_us: int, thrust_m_s2: float, elapsed_s: float) -> None:
        """Take the specific force by thrust of one sample of a vehicle in free air.

        Propellers push nothing down: a vehicle whose specific force points down lies on its back.
        """
        if self.is_commanded(time_us) and thrust_m_s2 > 0.0 and elapsed_s > 0.0:
            self.known_s = min(self.known_s + elapsed_s, GAIN_MEMORY_S)
            self.full_m_s2 += (thrust_m_s2 / self.fraction - self.full_m_s2) * elapsed_s / self.known_s

    @property
    def most_m_s2(self) -> float:
        """Largest upward specific force that thrust can explain, m/s^2."""
        return MARGIN * self.full_m_s2 if self.is_known else STRONGEST_M_S2

    def expected_m_s2(self, time_us: int, mean_m_s2: float) -> float:
        """Expected f_z in free air: from the commanded thrust, else its recent mean."""
        return -self.full_m_s2 * self.fraction if self.is_known and self.is_commanded(time_us) else mean_m_s2
