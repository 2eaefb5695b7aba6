"""Detector `lateral` on the specific force of eq. 2, seen through an averaging IMU."""

import math

import pytest

from companion.detection.interface import Phase
from companion.detection.lateral import LateralConfig, LateralDetector
from companion.messages import ImuSample

B_S, K_S = 30.0, 500.0
STEP_US = 10
RNG_SPREAD = 0.25  # m/s^2, noise of the simulated HIGHRES_IMU


def eq2_force_m_s2(speed_m_s: float) -> list[float]:
    """Specific force every 10 us from first touch until the wall would have to pull."""
    fold, rate, force = 0.0, speed_m_s, []
    while (push := B_S * rate + K_S * fold) > 0.0:
        force.append(push)
        rate -= push * STEP_US * 1e-6
        fold += rate * STEP_US * 1e-6
    return force


def averaged(contact_at_us: int, speed_m_s: float, window_us: int, every_us: int, direction_deg: float = 180.0):
    """Samples of a stream whose windows end at multiples of `every_us`, with body drag as a free flight shows it."""
    force = eq2_force_m_s2(speed_m_s)
    c, s = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    for end_us in range(every_us, contact_at_us + 200_000, every_us):
        indices = [(t - contact_at_us) // STEP_US for t in range(end_us - window_us, end_us, STEP_US)]
        mean = sum(force[i] for i in indices if 0 <= i < len(force)) / len(indices)
        wobble = RNG_SPREAD * math.sin(end_us)
        yield ImuSample(end_us, (mean * c + wobble - 0.44, mean * s + wobble, -9.81), (0.0, 0.0, 0.0))


def run(samples, window_us=4000, off=lambda sample: None, **config):
    detector = LateralDetector(LateralConfig(**config), window_us)
    state, impacts, states = detector.initial(), [], []
    for sample in samples:
        state, impact = detector.step(state, sample, off(sample))
        states.append(state)
        if impact is not None:
            impacts.append(impact)
    return impacts, states


@pytest.mark.parametrize("speed_m_s", [1.0, 1.5, 2.0, 2.5])
@pytest.mark.parametrize("phase_us", [0, 900, 1900, 2990])
@pytest.mark.parametrize("direction_deg", [0, 90, 135, 180, 270])
def test_fires_on_the_first_sample_with_a_millisecond_of_contact_and_only_then(speed_m_s, phase_us, direction_deg):
    contact_us = 400_000 + phase_us

    impacts, _ = run(averaged(contact_us, speed_m_s, 4000, 4000, direction_deg))

    assert len(impacts) == 1
    first_due_us = math.ceil((contact_us + 1000) / 4000) * 4000
    assert impacts[0].sample_time_boot_us <= first_due_us
    assert impacts[0].sample_time_boot_us > contact_us
    assert impacts[0].contact_free_until_boot_us <= contact_us


def test_a_gap_in_the_stream_widens_what_may_have_been_contact():
    """At 50 Hz a contact may have begun in the 15 ms that were not seen."""
    impacts, _ = run(averaged(391_000, 2.0, 5000, 20_000), window_us=5000)
    assert impacts[0].sample_time_boot_us == 400_000
    assert impacts[0].contact_free_until_boot_us == 380_000


def test_the_peak_and_the_impulse_direction_are_followed_until_the_contact_is_quiet():
    impacts, states = run(averaged(402_900, 2.0, 4000, 4000, direction_deg=120.0))
    contact = [s for s in states if s.phase is Phase.CONTACT]
    assert states[-1].phase is Phase.ARMED
    first_m_s2 = math.hypot(*impacts[0].specific_force_frd_m_s2)
    assert contact[-1].peak_specific_force_m_s2 > 1.5 * first_m_s2
    x, y, _ = contact[-1].force_sum_frd_m_s2
    assert math.degrees(math.atan2(y, x)) == pytest.approx(120.0, abs=3.0)


def hits(*times_us, level=10.0, length_us=20_000):
    for t in range(4000, 2_000_000, 4000):
        loud = any(start <= t < start + length_us for start in times_us)
        yield ImuSample(t, (0.0, level if loud else 0.0, -9.81), (0.0, 0.0, 0.0))


def test_one_contact_is_one_detection_and_the_next_one_another():
    assert len(run(hits(400_000, 440_000))[0]) == 1, "20 ms of quiet is still the same contact"
    assert len(run(hits(400_000, 500_000))[0]) == 2


def test_thrust_and_free_fall_are_not_lateral():
    samples = [ImuSample(t, (0.5, 0.5, fz), (0.0, 0.0, 0.0)) for t, fz in enumerate([-9.8, -30.0, 0.0, 20.0] * 50)]
    assert run(samples)[0] == []


def test_threshold_is_the_configurations():
    assert run(hits(400_000, level=10.0), threshold_m_s2=12.0)[0] == []
    assert len(run(hits(400_000, level=13.0), threshold_m_s2=12.0)[0]) == 1


def test_off_is_silent_and_says_why():
    impacts, states = run(hits(400_000), off=lambda sample: "landing")
    assert impacts == []
    assert states[-1].describe() == "off (landing)"


def test_switched_on_in_the_middle_of_a_shake_it_waits_for_quiet():
    def off(sample):
        return "takeoff" if sample.time_boot_us < 405_000 else None

    impacts, states = run(hits(400_000, 700_000), off=off)

    assert [impact.sample_time_boot_us for impact in impacts] == [700_000]
    assert "quiet" in {s.describe() for s in states}
    assert states[-1].describe() == "armed"
