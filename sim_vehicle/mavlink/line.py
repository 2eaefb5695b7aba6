"""How much a link may carry: PX4's rule that thins the streams out, and a serial line that is only so fast.

Source: PX4's mavlink/mavlink_main.cpp (update_rate_mult, _main_loop_delay, the default data rate of a serial port).
"""

from collections.abc import Iterable
from dataclasses import dataclass

from sim_vehicle.mavlink.encode import Encoder, Message

# PX4's SITL starts its UDP links with -r 4000000.
FAST_BYTES_S = 4_000_000
# The loop of a link sleeps 10 s over the data rate, within these.
_LOOP_LEAST_US, _LOOP_MOST_US, _LOOP_US_BYTES_S = 1_500, 10_000, 10_000_000
# A message is sent this share of the loop's sleep before it is due.
_EARLY_SHARE = 0.3
# Something is always sent.
_LEAST_SHARE = 0.05
# Bits on the line for each byte: eight, a start and a stop bit.
_BITS = 10
# Of a flight controller's UART driver, in bytes.
_BUFFER_BYTES = 2_048
# By default PX4 plans with half of what a serial line can carry.
_PLANNED_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Line:
    """What lies under a link. ``baud`` None: so fast that nothing is held back."""

    baud: int | None = None
    planned_bytes_s: int = 0
    """MAV_n_RATE: how much PX4 may send; 0 for half of a serial line."""

    @property
    def data_rate_bytes_s(self) -> float:
        """What the streams together may take."""
        if self.baud is None:
            return FAST_BYTES_S
        return self.planned_bytes_s or _PLANNED_SHARE * self.baud / _BITS

    @property
    def early_us(self) -> int:
        """How long before it is due a message may be sent."""
        delay_us = min(max(_LOOP_US_BYTES_S / self.data_rate_bytes_s, _LOOP_LEAST_US), _LOOP_MOST_US)
        return int(delay_us) // 10 * round(10 * _EARLY_SHARE)

    def share(self, streams: Iterable[tuple[int, int]], constant: Iterable[tuple[int, int]]) -> float:
        """The factor, at most 1, by which the rates of ``streams`` shrink so that all fit beside ``constant``. Both:
        bytes and interval in microseconds of each stream.
        """
        wanted = sum(size * 1e6 / interval_us for size, interval_us in streams if interval_us > 0)
        kept = sum(size * 1e6 / interval_us for size, interval_us in constant if interval_us > 0)
        if wanted <= 0:
            return 1.0
        return min(max((self.data_rate_bytes_s - kept) / wanted, _LEAST_SHARE), 1.0)


FAST_LINE = Line()


class Outbox:
    """Messages in, packets out. Under it lies the transmit buffer of a serial port: bytes leave it at the line's speed,
    and what does not fit is lost. Without a serial line everything fits.
    """

    def __init__(self, encoder: Encoder, line: Line, now_us: int) -> None:
        self._encoder = encoder
        self._bytes_per_us = None if line.baud is None else line.baud / _BITS / 1e6
        self._waiting = 0.0
        self._now_us = now_us
        self._packets: list[bytes] = []

    def send(self, message: Message) -> None:
        """Make a packet of the message."""
        self.forward(self._encoder.packet(message))

    def forward(self, packet: bytes) -> None:
        """Send a packet as it is, be it somebody else's."""
        if self._bytes_per_us is not None:
            if not self.has_room(len(packet)):
                return
            self._waiting += len(packet)
        self._packets.append(packet)

    def advance(self, now_us: int) -> None:
        """Let time pass."""
        if self._bytes_per_us is not None:
            self._waiting = max(self._waiting - self._bytes_per_us * (now_us - self._now_us), 0.0)
            self._now_us = now_us

    def has_room(self, count: int) -> bool:
        """Whether ``count`` bytes would fit."""
        return self._bytes_per_us is None or self._waiting + count <= _BUFFER_BYTES

    def take(self) -> tuple[bytes, ...]:
        """All packets since the last call, in order."""
        packets = tuple(self._packets)
        self._packets.clear()
        return packets
