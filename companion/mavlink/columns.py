"""Many packets of one message at once, as columns: for whole logs, which packet by packet take ten times as long."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import development as dialect

from companion.mavlink.packet import payload_of


def columns_of(message_id: int, packets: Iterable[bytes]) -> npt.NDArray[Any]:
    """A row a packet, its fields by the names of the message. Checksums are taken to have been looked at."""
    message = dialect.mavlink_map[message_id]
    # struct's letters are NumPy's; the first is the order of bytes.
    order, *letters = message.native_format.decode()
    fields = zip(message.ordered_fieldnames, letters, message.lengths, strict=True)
    layout = np.dtype([(name, order + letter, (length,) if length > 1 else ()) for name, letter, length in fields])
    size = layout.itemsize
    # MAVLink 2 leaves out the zeros at a payload's end.
    payloads = (payload_of(packet).ljust(size, b"\0")[:size] for packet in packets)
    return np.frombuffer(b"".join(payloads), layout)
