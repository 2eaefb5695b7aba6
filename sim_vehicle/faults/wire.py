"""A wire that loses, delays, reorders, doubles and damages packets: pure, seeded, for any carrier of frames."""

import heapq
import random
from collections.abc import Iterable, Sequence

from sim_vehicle.faults.spec import WireFault

MAVLINK_1, MAVLINK_2 = 0xFE, 0xFD
# Header and checksum around the payload, and what a signature adds.
_AROUND_1, _AROUND_2, _SIGNATURE, SIGNED = 8, 12, 13, 0x01


def split(data: bytes) -> list[bytes]:
    """The frames in bytes that begin with one, by their stated lengths; what is none stays together as it came."""
    frames, start = [], 0
    while start < len(data):
        size = packet_size(data, start)
        if size is None or start + size > len(data):
            frames.append(data[start:])
            break
        frames.append(data[start : start + size])
        start += size
    return frames


def packet_size(data: bytes, start: int) -> int | None:
    """Of the packet that may begin at ``start``; None where none does, or its header is not complete."""
    if start + 3 > len(data):
        return None
    if data[start] == MAVLINK_1:
        return _AROUND_1 + data[start + 1]
    if data[start] == MAVLINK_2:
        return _AROUND_2 + data[start + 1] + (_SIGNATURE if data[start + 2] & SIGNED else 0)
    return None


def message_number(frame: bytes) -> int | None:
    """The message's number; None for bytes that are no frame."""
    if len(frame) >= _AROUND_2 and frame[0] == MAVLINK_2:
        return int.from_bytes(frame[7:10], "little")
    return frame[5] if len(frame) >= _AROUND_1 and frame[0] == MAVLINK_1 else None


class Wire:
    """One direction of a link. The same frames at the same times meet the same fate for the same seed."""

    def __init__(self, faults: Iterable[WireFault], seed: int) -> None:
        """``faults`` have their messages by number."""
        self._seed = seed
        self._stretches: list[_Stretch] = []
        self._faults_so_far = 0
        self._held: list[tuple[int, int, bytes]] = []
        self._count = 0
        for fault in faults:
            self.add(fault)

    def add(self, fault: WireFault) -> None:
        """One more fault, with chances of its own."""
        rng = random.Random(self._seed + 7919 * self._faults_so_far)
        self._faults_so_far += 1
        self._stretches.append(_Stretch(fault, rng))

    def remove(self, fault: WireFault) -> None:
        """The very fault that was added is over; what it holds back still arrives when it would have."""
        self._stretches = [stretch for stretch in self._stretches if stretch.fault is not fault]

    def carry(self, frames: Sequence[bytes], now_us: int) -> tuple[bytes, ...]:
        """Put frames in at a time; take out all that have arrived by then, in the order of their arrival."""
        time_s = now_us / 1e6
        acting = [stretch for stretch in self._stretches if stretch.start_s <= time_s < stretch.end_s]
        if not acting and not self._held:
            return tuple(frames)
        for frame in frames:
            self._put(frame, now_us, acting)
        arrived = []
        while self._held and self._held[0][0] <= now_us:
            arrived.append(heapq.heappop(self._held)[2])
        return tuple(arrived)

    def _put(self, frame: bytes, now_us: int, acting: "list[_Stretch]") -> None:
        copies = [(now_us, frame)]
        for stretch in acting:
            if stretch.hits(frame):
                copies = [fate for due_us, copy in copies for fate in stretch.fates(copy, due_us)]
        for due_us, copy in copies:
            # Numbered, so that what arrives together keeps its order.
            heapq.heappush(self._held, (due_us, self._count, copy))
            self._count += 1


class _Stretch:
    """One fault and its chances."""

    def __init__(self, fault: WireFault, rng: random.Random) -> None:
        self.start_s, self.end_s = fault.window_s
        self.fault = fault
        self._rng = rng
        self._in_burst = False
        self._last_due_us = 0

    def hits(self, frame: bytes) -> bool:
        """Whether the fault is about such messages."""
        return not self.fault.messages or message_number(frame) in self.fault.messages

    def fates(self, frame: bytes, due_us: int) -> list[tuple[int, bytes]]:
        """When which copies of a frame arrive."""
        fault, chance = self.fault, self._rng.random
        if self._is_lost():
            return []
        due_us += round(1e6 * (fault.delay_s + fault.jitter_s * chance()))
        if fault.reorder and chance() < fault.reorder:
            due_us += round(1e6 * fault.reorder_by_s)
        else:
            due_us = self._last_due_us = max(due_us, self._last_due_us)
        if fault.corrupt and chance() < fault.corrupt:
            frame = self._damaged(frame)
        return [(due_us, frame)] * (2 if fault.duplicate and chance() < fault.duplicate else 1)

    def _is_lost(self) -> bool:
        """Gilbert's channel: while it is bad everything is lost; how often it turns makes share and run length."""
        fault, chance = self.fault, self._rng.random()
        if fault.loss in (0.0, 1.0):
            return fault.loss == 1.0
        if fault.burst_packets == 1.0:
            return chance < fault.loss
        if self._in_burst:
            self._in_burst = chance >= 1.0 / fault.burst_packets
        else:
            self._in_burst = chance < fault.loss / (1.0 - fault.loss) / fault.burst_packets
        return self._in_burst

    def _damaged(self, frame: bytes) -> bytes:
        place = self._rng.randrange(len(frame))
        return frame[:place] + bytes([frame[place] ^ self._rng.randrange(1, 256)]) + frame[place + 1 :]
