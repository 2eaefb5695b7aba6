"""What the propellers can do to the accelerometer's z axis: push up, at most as hard as they can."""

from dataclasses import dataclass

# A quadrotor lifts between 1.3 and 5 times its weight. Where nothing is heard of the thrust asked for, a push from
# below counts only beyond the strongest vehicle's own: that much is lost without ATTITUDE_TARGET.
STRONGEST_M_S2 = 5.0 * 9.81
# The gain follows a sagging battery (minutes) and not a climb (its thrust is in the message).
GAIN_MEMORY_S = 2.0
# Below this thrust the gain is a quotient of small numbers.
LEAST_FRACTION = 0.1
# The thrust asked for is what the motors make a few of their lags (20 ms) later; older than this it is history.
KEPT_US = 300_000
# A gain is trusted when it was learnt over this long in the air.
LEAST_LEARNT_S = 0.5
# Between two messages 20 to 50 ms apart the thrust asked for changes by no more than this share of the greatest.
CHANGE = 0.3
# Batteries, ground effect and a mean that is not yet settled: the gain is good to this.
MARGIN = 1.15


@dataclass(slots=True)
class ThrustGain:
    """Specific force at full thrust, learnt as -f_z over the thrust asked for. Changed only by its methods."""

    fraction: float = 0.0
    fraction_boot_us: int = -KEPT_US
    full_m_s2: float = 0.0
    known_s: float = 0.0

    def set_fraction(self, time_us: int, fraction: float) -> None:
        self.fraction, self.fraction_boot_us = fraction, time_us

    def learn(self, time_us: int, f_z: float, elapsed_s: float) -> None:
        """Take the z axis of one sample of a vehicle in the air that nothing touches."""
        if self.fraction < LEAST_FRACTION or time_us - self.fraction_boot_us > KEPT_US:
            return
        known_s = self.known_s = min(self.known_s + elapsed_s, GAIN_MEMORY_S)
        if known_s > 0.0:
            self.full_m_s2 += (-f_z / self.fraction - self.full_m_s2) * elapsed_s / known_s

    def most_m_s2(self, time_us: int) -> float:
        """The hardest push up that thrust can explain now."""
        if self.known_s < LEAST_LEARNT_S or time_us - self.fraction_boot_us > KEPT_US:
            return STRONGEST_M_S2
        return MARGIN * self.full_m_s2 * min(1.0, self.fraction + CHANGE)

    def expected_m_s2(self, time_us: int, mean_m_s2: float) -> float:
        """f_z of a vehicle that nothing touches: by the thrust asked for, else its recent mean."""
        if self.known_s < LEAST_LEARNT_S or time_us - self.fraction_boot_us > KEPT_US:
            return mean_m_s2
        return -self.full_m_s2 * self.fraction
