"""Small PX4 logs, written byte by byte as docs.px4.io/main/en/dev_log/ulog_file_format describes them."""

import struct

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35\x01"
LETTERS = {"uint64_t": "Q", "uint32_t": "I", "int32_t": "i", "uint8_t": "B", "bool": "?", "float": "f"}


def message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


# A type of which others are made: position_setpoint_triplet holds three of these.
NESTED = {"position_setpoint": [("bool", "valid"), ("uint8_t", "type")]}


def formats(topics):
    for name, fields in NESTED.items():
        yield message("F", f"{name}:{';'.join(f'{kind} {field}' for kind, field in fields)};".encode())
    for name, (fields, _) in topics.items():
        text = ";".join(f"{kind} {field}" for kind, field in (("uint64_t", "timestamp"), *fields))
        yield message("F", f"{name}:{text};".encode())


def packed(fields, row):
    values, letters = [], "<"
    for (kind, _), value in zip((("uint64_t", "timestamp"), *fields), row, strict=True):
        if kind in NESTED:
            letters += "".join(LETTERS[inner] for inner, _ in NESTED[kind])
            values.extend(value)
            continue
        name, _, count = kind.partition("[")
        letters += (count.rstrip("]") or "1") + LETTERS[name]
        values.extend(value if count else [value])
    return struct.pack(letters, *values)


def ulog(topics, started_us=0, info=(), parameters=()):
    """Topics: name -> ([(type, field), ...], [(timestamp_us, value, ...), ...]); rows go in by time."""
    parts = [MAGIC, struct.pack("<Q", started_us), message("B", bytes(40))]
    for kind, key, value in info:
        text = f"{kind} {key}".encode()
        parts.append(message("I", bytes([len(text)]) + text + value))
    for key, value in parameters:
        text = f"float {key}".encode()
        parts.append(message("P", bytes([len(text)]) + text + struct.pack("<f", value)))
    parts.extend(formats(topics))
    rows = []
    for number, (name, (fields, content)) in enumerate(topics.items()):
        parts.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
        rows.extend((row[0], number, packed(fields, row)) for row in content)
    parts.extend(message("D", struct.pack("<H", number) + row) for _, number, row in sorted(rows))
    return b"".join(parts)


SENSOR_COMBINED = [
    ("float[3]", "gyro_rad"),
    ("uint32_t", "gyro_integral_dt"),
    ("int32_t", "accelerometer_timestamp_relative"),
    ("float[3]", "accelerometer_m_s2"),
    ("uint32_t", "accelerometer_integral_dt"),
    ("uint8_t", "accelerometer_clipping"),
]


def sensor_combined(times_us, force=lambda time_us: (0.0, 0.0, -9.8), clipped=()):
    rows = [(t, (0.1, 0.2, 0.3), 5000, 0, force(t), 5000, int(t in clipped)) for t in times_us]
    return SENSOR_COMBINED, rows


def every(interval_us, start_us, end_us):
    return range(start_us, end_us, interval_us)
