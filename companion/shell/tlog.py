"""Telemetry logs as every MAVLink tool reads them: 8 bytes of big-endian microseconds, then the packet."""

import os
import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from companion.mavlink.packet import Stray, message_id_of, packet_length

_STAMP = struct.Struct(">Q")
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
        stamp = _STAMP.pack(now_us)
        self._pending += [part for frame in frames for part in (stamp, frame)]
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
        if not self._file.closed:
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
    while position + _STAMP.size < len(content):
        stamp_us = int(_STAMP.unpack_from(content, position)[0])
        start = position + _STAMP.size
        length = packet_length(content, start)
        if length == 0 or not _plausible(stamp_us, last_us) or not _stamp_follows(content, start + length, stamp_us):
            position += 1
            continue
        if start + length > len(content):
            return
        yield stamp_us, content[start : start + length], start + length
        last_us = stamp_us
        position = start + length


def may_be_logged(frame: bytes) -> bool:
    """Whether what was received is a packet: what is not could hide others from a reader.

    One that carries a key is in no log.
    """
    return not isinstance(frame, Stray) and message_id_of(frame) != SETUP_SIGNING


def _plausible(stamp_us: int, last_us: int | None) -> bool:
    return last_us is None or abs(stamp_us - last_us) <= _LONGEST_GAP_US


def _stamp_follows(content: bytes, end: int, stamp_us: int) -> bool:
    """Whether what comes after a packet is another stamp or the end of the file."""
    if end + _STAMP.size > len(content):
        return True
    return _plausible(int(_STAMP.unpack_from(content, end)[0]), stamp_us)
