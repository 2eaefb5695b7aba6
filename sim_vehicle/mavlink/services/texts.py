"""STATUSTEXT: sent only where a ground station is heard.

Source: PX4's mavlink/streams/STATUSTEXT.hpp and MavlinkReceiver::CheckHeartbeats. A companion that
announces itself as an onboard computer, on a link without a ground station, gets none.
"""

from collections import deque
from collections.abc import Iterator

from sim_vehicle.autopilot.commander.watching import HEARTBEAT_TIMEOUT_US
from sim_vehicle.autopilot.messages import StatusText
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.encode import Message

# A text that nobody could hear for this long is not worth sending any more.
STALE_US = 5_000_000
# The stream's rate is 20 Hz, one text each time.
TEXT_INTERVAL_US = 50_000
# Depth of PX4's queue of texts: the oldest fall out.
QUEUE_LENGTH = 8


class TextLink:
    """Texts waiting for a ground station."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, StatusText]] = deque(maxlen=QUEUE_LENGTH)
        self.heard_us: int | None = None
        """When a ground station was heard last."""
        self._sent_us = -TEXT_INTERVAL_US
        self._number = 0

    def add(self, text: StatusText, now_us: int) -> None:
        """Queue a text."""
        self._waiting.append((now_us, text))

    def due(self, now_us: int) -> Iterator[Message]:
        """The messages of the next text, if it is time for one and somebody listens."""
        if not self._waiting or self.heard_us is None:
            return
        if now_us - self.heard_us > HEARTBEAT_TIMEOUT_US or now_us - self._sent_us < TEXT_INTERVAL_US:
            return
        while self._waiting:
            written_us, text = self._waiting.popleft()
            if now_us - written_us < STALE_US:
                self._sent_us = now_us
                yield from encode.status_texts(text, self._number)
                self._number += 1
                return
