"""The campaigns of the bench: how many cases of which family."""

from dataclasses import asdict
from typing import Any

from rebound_cli.campaign.plan import Campaign
from rebound_cli.detectors.hits import HitCase, draw_case, work_out_hit

# Beside the hits of the airframes as they are, one in so many again with more vibration, and with a worse velocity.
VARIED_SHARE = 8
# An IMU sample's spread on each axis: four public PX4 logs of healthy flights lie between 1.2 and 4 m/s^2.
VIBRATIONS_M_S2 = (0.05, 1.0, 2.0, 4.0)
# Of the vehicle's velocity estimate, RMS on each axis: motion capture, GPS with RTK, plain GPS.
VELOCITY_NOISES_M_S = (0.01, 0.06, 0.1, 0.2)
# Every so manyeth hit is heard by each detector at other thresholds too.
SWEEP_EVERY = 25


def hits_campaign(hits: int) -> Campaign:
    """So many hits as the airframes are, and an eighth more of each variation."""
    cases: list[HitCase] = [draw_case("plain", seed, sweeps=seed % SWEEP_EVERY < 2) for seed in range(hits)]
    for seed in range(hits, hits + hits // VARIED_SHARE):
        level = VIBRATIONS_M_S2[seed // 2 % len(VIBRATIONS_M_S2)]
        cases.append(draw_case("vibration", seed, vibration_m_s2=level))
    for seed in range(2 * hits, 2 * hits + hits // VARIED_SHARE):
        noise = VELOCITY_NOISES_M_S[seed // 2 % len(VELOCITY_NOISES_M_S)]
        cases.append(draw_case("velocity", seed, velocity_noise_m_s=noise))
    return Campaign("hits", {"hits": hits}, cases, work_out_hit)


def as_text(case: Any) -> str:
    """All that is needed to see a case again."""
    return ", ".join(f"{name}={value!r}" for name, value in asdict(case).items() if value is not None)
