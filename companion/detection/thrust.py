"""Range of the specific force on body z that the propellers can make: from zero to their maximum thrust."""

from dataclasses import dataclass

# A quadrotor lifts between 1.3 and 5 times its weight. Without ATTITUDE_TARGET a force from below counts only beyond
# the maximum of the strongest vehicle.
STRONGEST_M_S2 = 5.0 * 9.81
# Memory of the gain: it follows a sagging battery (minutes) and not a climb (its thrust is in the message).
GAIN_MEMORY_S = 2.0
# Below this commanded thrust the gain is a quotient of small numbers, and is not learnt.
LEAST_FRACTION = 0.1
# A commanded thrust is valid for this time. Motors follow it with a lag of 20 ms.
KEPT_US = 300_000
# A gain is valid when it was learnt over this time in the air.
LEAST_LEARNT_S = 0.5
# Between two messages 20 to 50 ms apart the commanded thrust changes by no more than this share of the maximum.
CHANGE = 0.3
# Error of the gain from the battery, ground effect and a mean that has not converged.
MARGIN = 1.15


@dataclass(slots=True)
class ThrustGain:
    """Specific force at full thrust, learnt as -f_z over the commanded thrust. Changed only by its methods."""

    fraction: float = 0.0
    fraction_boot_us: int = -KEPT_US
    full_m_s2: float = 0.0
    known_s: float = 0.0

    def set_fraction(self, time_us: int, fraction: float) -> None:
        self.fraction, self.fraction_boot_us = fraction, time_us

    def learn(self, time_us: int, f_z: float, elapsed_s: float) -> None:
        """Take f_z of one sample of a vehicle in free air."""
        if self.fraction < LEAST_FRACTION or time_us - self.fraction_boot_us > KEPT_US:
            return
        known_s = self.known_s = min(self.known_s + elapsed_s, GAIN_MEMORY_S)
        if known_s > 0.0:
            self.full_m_s2 += (-f_z / self.fraction - self.full_m_s2) * elapsed_s / known_s

    def most_m_s2(self, time_us: int) -> float:
        """Largest upward specific force that thrust can explain now, m/s^2."""
        if self.known_s < LEAST_LEARNT_S or time_us - self.fraction_boot_us > KEPT_US:
            return STRONGEST_M_S2
        return MARGIN * self.full_m_s2 * min(1.0, self.fraction + CHANGE)

    def expected_m_s2(self, time_us: int, mean_m_s2: float) -> float:
        """Expected f_z in free air: from the commanded thrust, else its recent mean."""
        if self.known_s < LEAST_LEARNT_S or time_us - self.fraction_boot_us > KEPT_US:
            return mean_m_s2
        return -self.full_m_s2 * self.fraction
