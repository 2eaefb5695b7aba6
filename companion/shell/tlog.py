"""Telemetry logs as every MAVLink tool reads them: 8 bytes of big-endian microseconds, then the packet."""

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from companion.mavlink.packet import Stray, message_id_of, packet_length

_STAMP_BYTES = 8
# It carries the secret key: MAVLink asks to leave it out of logs (mavlink.io, "Message Signing", "Logging").
SETUP_SIGNING = 256

# A killed process must leave a log complete to its last second; half of that leaves room for a slow disk.
FLUSH_INTERVAL_US = 500_000

# After foreign bytes the reader looks for the next stamp: this near to the last. Earlier than the last it may be too,
# as other programs stamp with a clock that can be set back.
_LONGEST_GAP_US = 3 * 24 * 3600 * 1_000_000


class TlogWriter:
    """Appends packets to a log and hands them to the operating system twice a second.

    With `sync_first` they are on the disk by then, and after a power cut the log is never ahead of what that call
    brings to the disk before.
    """

    def __init__(self, path: Path, sync_first: Callable[[], None] | None = None) -> None:
        self._file = path.open("wb", buffering=0)
        self._sync_first = sync_first
        self._pending: list[bytes] = []
        self._flushed_at_us: int | None = None

    def write(self, now_us: int, frames: Iterable[bytes]) -> None:
        """Log packets received or sent at `now_us` (microseconds since the epoch)."""
        stamp = now_us.to_bytes(_STAMP_BYTES)
        self._pending += [stamp + frame for frame in frames]
        if self._flushed_at_us is None:
            self._flushed_at_us = now_us
        elif now_us - self._flushed_at_us >= FLUSH_INTERVAL_US:
            self._flushed_at_us = now_us
            self.flush()

    def flush(self) -> None:
        """Write all that waits. Raises OSError, and drops what could not be written: the log goes on after a gap."""
        left = memoryview(b"".join(self._pending))
        self._pending.clear()
        if self._sync_first is not None:
            self._sync_first()
        # A file without a buffer takes what there is room for, and says only at the next write that there is no more.
        while left:
            left = left[self._file.write(left) :]
        if self._sync_first is not None:
            os.fdatasync(self._file.fileno())

    def close(self) -> None:
        with self._file:
            self.flush()


def read_tlog(path: Path) -> Iterator[tuple[int, bytes]]:
    """Each packet with its stamp in microseconds since the epoch."""
    return ((stamp_us, packet) for stamp_us, packet, _ in packets_in(path.read_bytes()))


def packets_in(content: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Each packet of a log with its stamp and where it ends.

    Bytes that belong to no packet are passed over; a last packet cut short by a kill is left out.
    """
    position = 0
    last_us: int | None = None
    while (start := position + _STAMP_BYTES) < len(content):
        stamp_us, end = int.from_bytes(content[position:start]), start + packet_length(content, start)
        # After a packet comes another stamp or the end of the file.
        follows = content[end : end + _STAMP_BYTES]
        next_us = int.from_bytes(follows) if len(follows) == _STAMP_BYTES else None
        if end == start or not _is_near(stamp_us, last_us) or not _is_near(stamp_us, next_us):
            position += 1
            continue
        if end > len(content):
            return
        yield stamp_us, content[start:end], end
        last_us, position = stamp_us, end


def may_be_logged(frame: bytes) -> bool:
    """Whether what was received is a packet: what is not could hide others from a reader.

    One that carries a key is in no log.
    """
    return not isinstance(frame, Stray) and message_id_of(frame) != SETUP_SIGNING


def _is_near(stamp_us: int, other_us: int | None) -> bool:
    return other_us is None or abs(stamp_us - other_us) <= _LONGEST_GAP_US
