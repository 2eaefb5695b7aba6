"""What the vehicle's estimator has taken off its IMU since a hit, as biases.

PX4 sends HIGHRES_IMU less the biases that its estimator has found, and SCALED_IMU as it is measured. What a clipped hit
hides it takes for biases in part: then HIGHRES_IMU lacks as much. Their difference shows it.
"""

import math
from dataclasses import dataclass, replace

from companion.messages import ImuSample, ScaledImu, Vector3
from companion.motion.config import MEMORY_STEPS, MOST_BIAS_M_S2, MOST_BIAS_RAD_S, ROUNDED_M_S2, SAME_SAMPLE_US
from companion.motion.vector import ZERO, minus, plus, towards


@dataclass(slots=True)
class TakenBiases:
    """Changed only by its methods. Body FRD."""

    force_m_s2: Vector3 = ZERO  # taken since the vehicle was free
    rates_rad_s: Vector3 = ZERO
    _free_m_s2: Vector3 = ZERO  # until then
    _free_rad_s: Vector3 = ZERO
    _newest_m_s2: Vector3 = ZERO
    _known: int = 0
    _sent: ImuSample | None = None  # the newest of each
    _measured: ScaledImu | None = None

    def take(self, sample: ScaledImu, is_free: bool) -> None:
        """Take a sample as it is measured, before or after the same one of HIGHRES_IMU. `is_free`: no hit hides
        anything."""
        self._measured = sample
        self._compare(is_free)

    def given_back(self, sample: ImuSample, is_free: bool) -> ImuSample:
        """Take one sample of HIGHRES_IMU; what it is with these."""
        self._sent = sample
        if self._measured is not None:
            self._compare(is_free)
        if is_free or self.force_m_s2 == ZERO:
            self.force_m_s2 = self.rates_rad_s = ZERO
            return sample
        force, rates = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
        return replace(
            sample,
            specific_force_frd_m_s2=plus(force, 1.0, self.force_m_s2),
            angular_velocity_frd_rad_s=plus(rates, 1.0, self.rates_rad_s),
        )

    def _compare(self, is_free: bool) -> None:
        sent, measured = self._sent, self._measured
        if sent is None or measured is None or abs(measured.time_boot_us - sent.time_boot_us) > SAME_SAMPLE_US:
            return
        force = minus(measured.specific_force_frd_m_s2, sent.specific_force_frd_m_s2)
        rates = minus(measured.angular_velocity_frd_rad_s, sent.angular_velocity_frd_rad_s)
        if is_free:
            # SCALED_IMU is the first sensor's. Another one differs from sample to sample, by vibration.
            is_same, self._newest_m_s2 = math.dist(force, self._newest_m_s2) <= ROUNDED_M_S2, force
            self._known = min(self._known + 1, MEMORY_STEPS) if is_same else self._known // 2 + 1
            self._free_m_s2 = towards(self._free_m_s2, force, 1.0 / self._known)
            self._free_rad_s = towards(self._free_rad_s, rates, 1.0 / self._known)
            return
        force, rates = minus(force, self._free_m_s2), minus(rates, self._free_rad_s)
        is_known = 2 * self._known > MEMORY_STEPS
        # More is no bias but another sensor.
        if is_known and math.hypot(*force) <= MOST_BIAS_M_S2 and math.hypot(*rates) <= MOST_BIAS_RAD_S:
            self.force_m_s2, self.rates_rad_s = force, rates
