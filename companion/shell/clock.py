"""The one real clock of a flight."""

import time

# The low two bits of a telemetry log's stamp are the link number by MAVProxy's convention, so
# every stamp is a multiple of 4 us and reads as link 0.
STAMP_STEP_US = 4


class Clock:
    """Microseconds since the epoch that never jump: the wall clock is read once, then time is monotonic."""

    def __init__(self) -> None:
        self._epoch_at_monotonic_zero_us = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def now_us(self) -> int:
        time_us = self._epoch_at_monotonic_zero_us + time.monotonic_ns() // 1000
        return time_us - time_us % STAMP_STEP_US

    def sleep(self, duration_s: float) -> None:
        time.sleep(max(duration_s, 0.0))
