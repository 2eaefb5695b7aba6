"""A sustained force from above: the vehicle commands more and more thrust, and does not rise.

A ceiling met slowly shows in no IMU sample: its force cancels the thrust that the loops add. It shows in the commanded
thrust (ATTITUDE_TARGET) that the accelerometer does not measure, while the vehicle stands still below its setpoint.
"""

from dataclasses import dataclass, field

from companion.detection.thrust import ThrustGain
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

    gain: ThrustGain = field(default_factory=ThrustGain)
    """Learnt at the setpoint or in a climb."""
    missing_m_s2: float = 0.0
    time_us: int = 0
    still_since_us: int = 0
    still_down_m: float = 0.0

    def forget(self) -> None:
        self.gain.known_s, self.time_us, self.missing_m_s2 = 0.0, 0, 0.0

    def step(self, sample: LocalPosition, thrust_m_s2: float, goal_down_m: float) -> SustainedForce | None:
        """Take one position, the measured thrust in m/s^2, and the setpoint's down coordinate in m."""
        now_us, down_m = sample.time_boot_us, sample.position_ned_m[2]
        elapsed_s = min((now_us - self.time_us) * 1e-6, SMOOTHING_S) if self.time_us else 0.0
        self.time_us = now_us
        if not self.gain.is_commanded(now_us):
            self.forget()
            return None
        is_below = down_m - goal_down_m > BESIDE_M
        if not is_below or abs(down_m - self.still_down_m) > STILL_M:
            self.still_since_us, self.still_down_m = now_us, down_m
        if not is_below or not self.gain.is_known:
            self.gain.learn(now_us, thrust_m_s2, elapsed_s)
            self.missing_m_s2 = 0.0
            return None
        missing = self.gain.full_m_s2 * self.gain.fraction - thrust_m_s2
        self.missing_m_s2 += elapsed_s / (SMOOTHING_S + elapsed_s) * (missing - self.missing_m_s2)
        if self.missing_m_s2 < HELD_M_S2 or now_us - self.still_since_us < STILL_US:
            return None
        since_us, self.still_since_us = self.still_since_us, now_us
        return SustainedForce((0.0, 0.0, 1.0), self.missing_m_s2, since_us)
