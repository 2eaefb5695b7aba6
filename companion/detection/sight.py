"""Can the detector see? A blind detector is a state that is told, never silence."""

from typing import NamedTuple

from companion.written import Positive, Written

# The received rate is judged over this: 20 samples at the least rate, and no longer than a link's brief gap.
RATE_WINDOW_US = 1_000_000


class SightConfig(Written):
    """When a detector counts as blind."""

    # Ten samples of PX4's default 50 Hz, with reserve: whoever waits longer for one sees no hit in time.
    silence_s: Positive = 0.25
    # 20 Hz is one sample in 50 ms: the longest contacts, about 100 ms, would show in two, most in none.
    min_rate_hz: Positive = 20.0
    # By eq. 2 a hit at 1 m/s begins with b_s v_c = 30 m/s^2: a vehicle that shakes so much that less cannot be
    # told from its shaking does not see the slower half of its hits.
    max_threshold_m_s2: Positive = 30.0


class Sight(NamedTuple):
    """What decides whether the detector sees: when it last heard, and how often. A tuple: one is made in every step."""

    last_heard_us: int
    window_started_us: int
    heard_in_window: int = 0
    rate_hz: float | None = None
    blind_reason: str | None = None


def heard(sight: Sight, imu_samples: int, now_us: int) -> Sight:
    """With the IMU samples that arrived by ``now_us`` (companion's clock)."""
    count, started_us, rate_hz = sight.heard_in_window + imu_samples, sight.window_started_us, sight.rate_hz
    elapsed_us = now_us - started_us
    if elapsed_us >= RATE_WINDOW_US:
        rate_hz, count, started_us = count * 1e6 / elapsed_us, 0, now_us
    last_us = now_us if imu_samples else sight.last_heard_us
    return Sight(last_us, started_us, count, rate_hz, sight.blind_reason)


def why_blind(sight: Sight, threshold_m_s2: float, config: SightConfig, now_us: int) -> str | None:
    """One phrase, or None for a detector that sees."""
    if now_us - sight.last_heard_us > config.silence_s * 1e6:
        return f"no HIGHRES_IMU for {round(config.silence_s * 1e3)} ms"
    if sight.rate_hz is not None and sight.rate_hz < config.min_rate_hz:
        return f"HIGHRES_IMU at {sight.rate_hz:.0f} Hz, below {config.min_rate_hz:g}"
    if threshold_m_s2 > config.max_threshold_m_s2:
        return f"vibration hides hits below {threshold_m_s2:.0f} m/s^2"
    return None
