"""A sustained force from above: the vehicle commands more and more thrust, and does not rise.

A ceiling met slowly shows in no IMU sample: its force cancels the thrust that the loops add. It shows in the commanded
thrust (ATTITUDE_TARGET) that the accelerometer does not measure, while the vehicle stands still below its setpoint.
"""

from dataclasses import dataclass

from companion.detection.thrust import GAIN_MEMORY_S, KEPT_US, LEAST_FRACTION
from companion.flight.horizontal_force import BESIDE_M, HELD_M_S2, SustainedForce
from companion.messages import LocalPosition

# Time to stand still: a vehicle with a failed motor turns round, or comes back, sooner.
STILL_US = 1_000_000
# Largest motion of a vehicle that stands still: half of a slow return's after a motor's loss.
STILL_M = 0.05
# Of a vibration of 3 m/s^2, sampled at 50 Hz, a tenth is left.
SMOOTHING_S = 0.5


@dataclass(slots=True)
class VerticalForceMonitor:
    """Updated with each position while setpoints are flown; reset by `forget`. Boot clock."""

    fraction: float = 0.0
    thrust_us: int = -KEPT_US
    full_m_s2: float = 0.0
    """Specific force at full thrust, measured at the setpoint or in a climb."""
    known_s: float = 0.0
    missing_m_s2: float = 0.0
    time_us: int = 0
    still_since_us: int = 0
    still_down_m: float = 0.0

    def forget(self) -> None:
        self.known_s, self.time_us, self.missing_m_s2 = 0.0, 0, 0.0

    def add_thrust(self, time_us: int, fraction: float) -> None:
        """Take the commanded thrust, 0 to 1."""
        self.fraction, self.thrust_us = fraction, time_us

    def step(self, sample: LocalPosition, thrust_m_s2: float, goal_down_m: float) -> SustainedForce | None:
        """Take one position, the measured thrust in m/s^2, and the setpoint's down coordinate in m."""
        now_us, down_m = sample.time_boot_us, sample.position_ned_m[2]
        elapsed_s = min((now_us - self.time_us) * 1e-6, SMOOTHING_S) if self.time_us else 0.0
        self.time_us = now_us
        if self.fraction < LEAST_FRACTION or now_us - self.thrust_us > KEPT_US:
            self.forget()
            return None
        is_below = down_m - goal_down_m > BESIDE_M
        if not is_below or abs(down_m - self.still_down_m) > STILL_M:
            self.still_since_us, self.still_down_m = now_us, down_m
        if not is_below or self.known_s < GAIN_MEMORY_S:
            self.known_s = min(self.known_s + elapsed_s, GAIN_MEMORY_S)
            share = elapsed_s / self.known_s if self.known_s > 0.0 else 1.0
            self.full_m_s2 += share * (thrust_m_s2 / self.fraction - self.full_m_s2)
            self.missing_m_s2 = 0.0
            return None
        missing = self.full_m_s2 * self.fraction - thrust_m_s2
        self.missing_m_s2 += elapsed_s / (SMOOTHING_S + elapsed_s) * (missing - self.missing_m_s2)
        if self.missing_m_s2 < HELD_M_S2 or now_us - self.still_since_us < STILL_US:
            return None
        since_us, self.still_since_us = self.still_since_us, now_us
        return SustainedForce((0.0, 0.0, 1.0), self.missing_m_s2, since_us)
