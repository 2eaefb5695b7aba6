"""Small PX4 logs, as our own export writes them and pyulog reads them."""

import struct

from rebound_cli.export.ulog import Row, written


def ulog(topics, started_us=0, info=None, parameters=()):
    """Topics: name -> ("field field ...", [(timestamp_us, value, ...), ...])."""
    rows = [
        Row(time_us, name, dict(zip(fields.split(), values, strict=True)))
        for name, (fields, content) in topics.items()
        for time_us, *values in content
    ]
    numbers = {f"float {key}": struct.pack("<f", value) for key, value in parameters}
    return written(rows, started_us, info or {}, numbers)


def sensor_combined(times_us, force=lambda time_us: (0.0, 0.0, -9.8), clipped=()):
    fields = "gyro_rad accelerometer_m_s2 accelerometer_integral_dt accelerometer_clipping"
    return fields, [(t, (0.1, 0.2, 0.3), force(t), 5000, int(t in clipped)) for t in times_us]


def every(interval_us, start_us, end_us):
    return range(start_us, end_us, interval_us)
