"""The detectors that `fused` is compared with: each sees what its source says it sees, and not what it cannot."""

import math
import random

import pytest

from bench.detectors.config import BaselineConfig
from companion.messages import Attitude, AttitudeTarget, ImuSample, LandedState, LocalPosition, Sample
from companion.motion.vector import plus
from companion.reflex.detector import Situation
from companion.reflex.monitor import advance, start_monitor

TICK_US = 4_000
HIT_US = 4_000_000
HOVER = 0.7
LEVEL = (1.0, 0.0, 0.0, 0.0)


def fly(detector, push=lambda t: (0.0, 0.0, 0.0), lift=lambda t: 9.81, until_us=6_000_000, off=None):
    """North at 2 m/s behind a setpoint that goes on; pushed by `push(t)`, m/s^2."""
    monitor = start_monitor(BaselineConfig(detector=detector), 0)
    velocity, position, impacts = (2.0, 0.0, 0.0), (0.0, 0.0, -3.0), []
    for t in range(TICK_US, until_us, TICK_US):
        p, thrust = push(t), lift(t)
        force = (p[0], p[1], p[2] - thrust)
        acceleration = (force[0], force[1], force[2] + 9.81)
        velocity = plus(velocity, TICK_US * 1e-6, acceleration)
        position = plus(position, TICK_US * 1e-6, velocity)
        wobble = 0.1 * math.sin(t)
        samples: list[Sample] = [ImuSample(t, (force[0] + wobble, force[1], force[2]), (0.0, 0.0, 0.0))]
        if t % 20_000 == 0:
            samples.append(LocalPosition(t, position, velocity))
            samples.append(Attitude(t, LEVEL))
            samples.append(AttitudeTarget(t, HOVER * thrust / 9.81))
        situation = Situation(
            off_reason=off,
            armed=True,
            landed_state=LandedState.IN_AIR,
            height_m=3.0,
            setpoint_position_ned_m=(2.0 * t * 1e-6, 0.0, -3.0),
        )
        impacts += advance(monitor, samples, situation, t).impacts
    return impacts


def pushed(push, length_us=60_000):
    return lambda t: push if HIT_US <= t < HIT_US + length_us else (0.0, 0.0, 0.0)


def wall(strength, length_us=60_000):
    return pushed((-strength, 0.0, 0.0), length_us)


# Least and most that follow from what each looks at.
LATE_MS = {"fused": (0, 0), "lateral": (0, 0), "fuzzy": (0, 0), "hybrid": (0, 4)}
LATE_MS |= {"threshold": (18, 88), "momentum": (12, 60), "tracking": (80, 400)}


@pytest.mark.parametrize("detector", sorted(BaselineConfig.detectors))
def test_every_detector_sees_a_hard_hit_once_and_is_silent_before_it_and_when_it_is_off(detector):
    """Twice what the published threshold asks for, for sixty milliseconds; the vehicle is thrown back at 0.4 m/s."""
    (impact,) = fly(detector, wall(40.0))
    assert impact.impact.contact_free_until_boot_us < HIT_US
    assert fly(detector, wall(40.0), off="landing") == []
    least_ms, most_ms = LATE_MS[detector]
    assert least_ms <= 1e-3 * (impact.impact.sample_time_boot_us - HIT_US) <= most_ms


# The setpoint of `tracking` does not climb.
@pytest.mark.parametrize("detector", sorted({*BaselineConfig.detectors} - {"tracking"}))
def test_a_climb_with_its_thrust_told_is_no_hit(detector):
    def climb(t):
        return 9.81 + 3.0 * max(0.0, math.sin((t - HIT_US) * 4e-6)) if HIT_US < t < HIT_US + 785_000 else 9.81

    assert fly(detector, lift=climb) == []


def test_the_fixed_threshold_takes_gravity_off_the_body_z_axis():
    (impact,) = fly("threshold", pushed((0.0, 0.0, 25.0), 8_000))
    assert impact.impact.specific_force_frd_m_s2[2] == pytest.approx(25.0, abs=0.01)


def test_the_fixed_threshold_tells_its_windows_largest_push_eleven_samples_after_the_first():
    """Five samples from 25 to 60 and back to 30 m/s^2."""
    pushes = (25.0, 40.0, 60.0, 45.0, 30.0)

    def growing(t):
        index = (t - HIT_US) // TICK_US
        return (-pushes[index], 0.0, 0.0) if 0 <= index < len(pushes) else (0.0, 0.0, 0.0)

    (impact,) = fly("threshold", growing)
    assert impact.impact.sample_time_boot_us == HIT_US + 11 * TICK_US
    assert impact.impact.specific_force_frd_m_s2[0] == pytest.approx(-60.0, abs=0.2)
    assert impact.impact.contact_free_until_boot_us == HIT_US - 5_000  # the first sample's averaging


def twice(gap_us):
    return lambda t: wall(10.0, 20_000)(t) if t < HIT_US + 20_000 else wall(10.0, 20_000)(t - 20_000 - gap_us)


@pytest.mark.parametrize(
    ("detector", "push", "seen"),
    [
        # The fixed threshold is for each axis and not for the magnitude
        ("threshold", pushed((-18.0, 18.0, 0.0)), 0),
        ("threshold", wall(21.0), 1),
        # The horizontal one looks sideways alone
        ("fuzzy", pushed((0.0, 0.0, -12.0)), 0),
        ("fuzzy", wall(9.6), 0),
        ("fuzzy", wall(10.0), 1),
        ("fuzzy", pushed((0.0, -10.0, 0.0)), 1),
        ("lateral", wall(3.6), 0),
        ("lateral", wall(4.4), 1),
        # 20 ms of quiet is still the same contact
        ("lateral", twice(20_000), 1),
        ("lateral", twice(80_000), 2),
    ],
)
def test_a_force_is_a_hit_from_its_threshold_on_once_a_contact(detector, push, seen):
    assert len(fly(detector, push)) == seen


@pytest.mark.parametrize("spread_m_s2", [1.0, 3.0])
def test_a_shaking_vehicle_raises_its_own_threshold_and_sees_nothing(spread_m_s2):
    chance = random.Random(7)
    assert fly("lateral", lambda t: (chance.gauss(0.0, spread_m_s2), chance.gauss(0.0, spread_m_s2), 0.0)) == []
