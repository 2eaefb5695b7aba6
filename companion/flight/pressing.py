"""Pressed on what is above: the vehicle asks for more and more thrust, and does not rise.

A ceiling met slowly shows in no sample: what presses the vehicle down is as large as what its loops add to the thrust,
and the accelerometer shows their difference, a hover's. It shows in the thrust that is asked for (ATTITUDE_TARGET) and
that the accelerometer does not find, while the vehicle stands still below where it is to be.
"""

from dataclasses import dataclass

from companion.detection.thrust import GAIN_MEMORY_S, KEPT_US, LEAST_FRACTION
from companion.flight.leaning import BESIDE_M, HELD_M_S2, Held
from companion.messages import LocalPosition

# For so long it has to stand still: a vehicle that a motor has let down turns round faster, or comes back faster.
STILL_US = 1_000_000
# Still within so much: of a slow return after a motor's loss that is half of what it does in that time.
STILL_M = 0.05
# Shaking of 3 m/s^2, heard at 50 Hz, leaves a tenth of it.
SMOOTHING_S = 0.5


@dataclass(slots=True)
class Pressing:
    """Looked at with each position while setpoints are flown; started again by `forget`. Boot clock."""

    fraction: float = 0.0
    told_us: int = -KEPT_US
    full_m_s2: float = 0.0
    """What all thrust would give: as found while the vehicle was where it was to be, or on its way up."""
    known_s: float = 0.0
    missing_m_s2: float = 0.0
    time_us: int = 0
    still_since_us: int = 0
    still_down_m: float = 0.0

    def forget(self) -> None:
        self.known_s, self.time_us, self.missing_m_s2 = 0.0, 0, 0.0

    def tell(self, time_us: int, fraction: float) -> None:
        """Take the thrust that is asked for."""
        self.fraction, self.told_us = fraction, time_us

    def step(self, sample: LocalPosition, thrust_m_s2: float, goal_down_m: float) -> Held | None:
        """Take one sample, what the accelerometer shows of the thrust, and the height as last asked for."""
        now_us, down_m = sample.time_boot_us, sample.position_ned_m[2]
        elapsed_s = min((now_us - self.time_us) * 1e-6, SMOOTHING_S) if self.time_us else 0.0
        self.time_us = now_us
        if self.fraction < LEAST_FRACTION or now_us - self.told_us > KEPT_US:
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
        return Held((0.0, 0.0, 1.0), self.missing_m_s2, since_us)
