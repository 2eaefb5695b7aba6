"""Small PX4 logs, as our own export writes them and pyulog reads them."""

import struct

from rebound_cli.export.ulog import Row, written


def ulog(topics, started_us=0, info=None, parameters=()):
    """Topics: name -> ([(type, field), ...], [(timestamp_us, value, ...), ...])."""
    rows = [
        Row(time_us, (name, ";".join(f"{kind} {field}" for kind, field in fields)), flat(values))
        for name, (fields, content) in topics.items()
        for time_us, *values in content
    ]
    return written(
        rows, started_us, info or {}, {f"float {key}": struct.pack("<f", value) for key, value in parameters}
    )


def flat(values):
    return [one for value in values for one in (value if isinstance(value, tuple) else (value,))]


SENSOR_COMBINED = [
    ("float[3]", "gyro_rad"),
    ("float[3]", "accelerometer_m_s2"),
    ("uint32_t", "accelerometer_integral_dt"),
    ("uint8_t", "accelerometer_clipping"),
]


def sensor_combined(times_us, force=lambda time_us: (0.0, 0.0, -9.8), clipped=()):
    return SENSOR_COMBINED, [(t, (0.1, 0.2, 0.3), force(t), 5000, int(t in clipped)) for t in times_us]


def every(interval_us, start_us, end_us):
    return range(start_us, end_us, interval_us)
