"""The smallest hit that a vehicle's own noise leaves visible, and the false alarms that its thresholds mean."""

import pytest

from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO
from companion.reflex.config import EXCESS, FusedConfig
from companion.reflex.fused import FusedState
from companion.reflex.health import promise_of

FIXES = [VelocityFix(time_us, ZERO, ZERO) for time_us in range(0, 1_000_001, 20_000)]
CONFIG = FusedConfig()


def promise(side_m_s2, imu_hz=250):
    state = FusedState()
    state.floor.side_m_s2 = EXCESS * side_m_s2
    state.threshold_m_s2 = max(CONFIG.side_threshold_m_s2, CONFIG.noise_factor * EXCESS * side_m_s2)
    state.jump.known = 100
    return promise_of(state, CONFIG, FIXES, imu_hz, True)


def test_noise_at_the_bound_exceeds_it_once_in_half_a_thousand_hours():
    # 6.3 standard deviations, 250 samples a second
    assert promise(side_m_s2=2.0).false_alarms_per_h == pytest.approx(1.0 / 460.0, rel=0.1)
    assert promise(side_m_s2=2.0, imu_hz=50).false_alarms_per_h == pytest.approx(1.0 / 2300.0, rel=0.1)


def test_a_quiet_vehicle_promises_less_false_alarms_and_sees_less_force():
    quiet, loud = promise(side_m_s2=0.1), promise(side_m_s2=2.0)
    assert quiet.false_alarms_per_h < 1e-6 * loud.false_alarms_per_h
    assert quiet.force_m_s2 == CONFIG.side_threshold_m_s2 < loud.force_m_s2
