"""What machines are compared by: one HIGHRES_IMU through pymavlink's own parser, whose checksum is fastcrc's."""

import statistics
from collections.abc import Callable
from time import perf_counter_ns

from pymavlink.dialects.v20 import development as dialect

_REPEATS = 2000


def parse_us(repeats: int = _REPEATS) -> float:
    """Median microseconds of `MAVLink.parse_buffer` on one packet as a vehicle in hover sends it."""
    link = dialect.MAVLink(None, 1, 1)
    force, rates, field, air = (0.1, -0.2, -9.8), (0.01, 0.02, -0.03), (0.2, 0.0, 0.4), (950.0, 0.0, 490.0, 20.0)
    packet = bytes(dialect.MAVLink_highres_imu_message(12_345_678, *force, *rates, *field, *air, 0x3F, 0).pack(link))
    return median_us(lambda: link.parse_buffer(packet), repeats)


def median_us(function: Callable[[], object], repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        begun = perf_counter_ns()
        function()
        spent.append(perf_counter_ns() - begun)
    return statistics.median(spent) / 1e3
