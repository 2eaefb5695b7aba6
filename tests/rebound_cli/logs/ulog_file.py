"""Small PX4 logs (docs.px4.io, ULog File Format), as pyulog reads them."""

import struct

_MAGIC = b"ULog\x01\x12\x35\x01"
_FLAG_BITS_SIZE = 40
# A value's type in the file, and how it is packed.
_KINDS = {bool: ("bool", "?"), int: ("uint64_t", "Q"), float: ("float", "f")}


def ulog(topics, started_us=0, info=None, parameters=()):
    """Topics: name -> ("field field ...", [(timestamp_us, value, ...), ...]).

    A field's type is that of its first value. Keys of `info` begin with the value's type.
    """
    parts = [_MAGIC, struct.pack("<Q", started_us), _message("B", bytes(_FLAG_BITS_SIZE))]
    parts += (_keyed("I", key, value) for key, value in (info or {}).items())
    parts += (_keyed("P", f"float {key}", struct.pack("<f", value)) for key, value in parameters)
    added, data = [], []
    for number, (topic, (names, rows)) in enumerate((name, rows) for name, rows in topics.items() if rows[1]):
        firsts = [_several(value) for value in rows[0][1:]]
        kinds = [(len(first), *_KINDS.get(type(first[0]), _KINDS[float])) for first in firsts]
        fields = [
            f"{kind}{f'[{n}]' if n > 1 else ''} {name};"
            for name, (n, kind, _) in zip(names.split(), kinds, strict=True)
        ]
        parts.append(_message("F", f"{topic}:uint64_t timestamp;{''.join(fields)}".encode()))
        added.append(_message("A", struct.pack("<BH", 0, number) + topic.encode()))
        packer = struct.Struct("<HQ" + "".join(f"{n}{letter}" for n, _, letter in kinds))
        for time_us, *values in rows:
            flat = [one for value in values for one in _several(value)]
            data.append((time_us, _message("D", packer.pack(number, time_us, *flat))))
    return b"".join([*parts, *added, *(message for _, message in sorted(data, key=lambda row: row[0]))])


def _several(value):
    return value if isinstance(value, list | tuple) else (value,)


def _keyed(kind, key, value):
    return _message(kind, bytes([len(key)]) + key.encode() + value)


def _message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


def sensor_combined(times_us, force=lambda time_us: (0.0, 0.0, -9.8), clipped=()):
    fields = "gyro_rad accelerometer_m_s2 accelerometer_integral_dt accelerometer_clipping"
    return fields, [(t, (0.1, 0.2, 0.3), force(t), 5000, int(t in clipped)) for t in times_us]


def every(interval_us, start_us, end_us):
    return range(start_us, end_us, interval_us)
