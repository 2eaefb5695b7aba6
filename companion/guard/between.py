"""The guard as the link: whole packets of the vehicle's and of its clients', bytes in and bytes out.

While `is_closed` what would move the vehicle is kept out (see moves.py), and setpoints while it `awaits_choice`.
All else passes unchanged and in the order of its sender. Packets of different senders take turns, so that no sender's
bytes come inside another's packet: an unfinished packet stays here, and so do bytes that begin none.
"""

from collections import deque
from dataclasses import dataclass, field

from companion.autopilot.known import ASSUMED
from companion.mavlink.decode import Decoder
from companion.mavlink.moves import SETPOINT_IDS, STICKS_IDS, asked_by, fields_of, interval_asked, is_for, would_move
from companion.mavlink.packet import MAGIC_V1, MAGIC_V2, Stray, checksum_holds, message_id_of
from companion.messages import Asked

# Of a client, still to be sent: a download of all parameters or a long mission is less.
MOST_WAITING_BYTES = 64_000
# After a pause so much may go at once: a quarter of a setpoint's interval. A driver holds more, and whatever waits
# there is in the guard's own way.
BURST_S = 0.005
# A short packet costs this computer as much as one of so many bytes.
LEAST_COST_BYTES = 64
# The guard looks where a program's setpoint leads: at 2 m/s it moves on by 0.2 m in this time.
TOLD_EVERY_US = 100_000

# Of the guard's own messages these are for people, who are behind it now.
_FOR_PEOPLE = frozenset({250, 251, 253, 390})  # DEBUG_VECT, NAMED_VALUE_FLOAT, STATUSTEXT, ONBOARD_COMPUTER_STATUS
_TIMESYNC = 111
# Questions of the guard's that may still be answered: one a second.
_MOST_ASKED = 64


@dataclass(slots=True)
class _Client:
    framer: Decoder
    waiting: deque[bytes] = field(default_factory=deque)
    is_flood_told: bool = False
    is_gone: bool = False


class Between:
    """Clients are called by their addresses. Times are microseconds, any epoch."""

    def __init__(self, bytes_per_s: float) -> None:
        """`bytes_per_s`: what the link to the vehicle carries."""
        self.is_closed = True  # until the guard has met the vehicle
        self.awaits_choice = False  # setpoints are kept out until somebody chooses a mode
        self.has_chosen = False  # a client has asked for one
        self.autopilot = ASSUMED  # whose modes are told apart
        self.system_id: int | None = None  # the vehicle's; what is for another passes
        self.kept_out = 0  # packets
        self.intervals: list[tuple[int | None, int]] = []  # asked for by clients, and not yet told to the guard
        self._setpoint: Asked | None = None
        self._told_us = 0
        self._rate = bytes_per_s
        self._clients: dict[str, _Client] = {}
        self._vehicle = Decoder({}, _is_whole)
        self._asked: deque[int] = deque(maxlen=_MOST_ASKED)
        self.news: deque[str] = deque()  # about a client, for a person
        self._budget_bytes, self._budget_us = 0.0, 0

    def has_room(self, client: str) -> bool:
        """Whether more of it can be taken; what is heard in spite of it is dropped."""
        return client not in self._clients or sum(map(len, self._clients[client].waiting)) < MOST_WAITING_BYTES

    @property
    def waits(self) -> bool:
        """Whether there is something still to be sent to the vehicle."""
        return any(client.waiting for client in self._clients.values())

    def hear(self, name: str, received: bytes) -> None:
        """Bytes of a client's."""
        client = self._clients[name] = self._clients.get(name) or _Client(Decoder({}, _is_whole))
        client.is_gone = False
        if self.has_room(name):
            client.waiting += [packet for packet, _ in client.framer.feed(received) if not isinstance(packet, Stray)]
        elif not client.is_flood_told:
            client.is_flood_told = True
            self.news.append(f"{name} sends more than the link to the vehicle carries: the rest of it is lost")

    def forget(self, name: str) -> None:
        """A client has gone; what it has said still goes."""
        if name in self._clients:
            self._clients[name].is_gone = True

    def to_vehicle(self, now_us: int) -> list[bytes]:
        """What goes now: a packet of each client in turn, as far as the link carries them."""
        since_s, self._budget_us = (now_us - self._budget_us) * 1e-6, now_us
        self._budget_bytes = min(self._budget_bytes + self._rate * since_s, self._rate * BURST_S)
        going: list[bytes] = []
        while self._budget_bytes > 0.0 and self.waits:
            for client in self._clients.values():
                if client.waiting:
                    packet = client.waiting.popleft()
                    if self._lets_pass(packet):
                        self._budget_bytes -= max(len(packet), LEAST_COST_BYTES)
                        going.append(packet)
        self._clients = {name: one for name, one in self._clients.items() if one.waiting or not one.is_gone}
        return going

    def to_clients(self, received: bytes) -> list[bytes]:
        """Bytes of the vehicle's: packets, and whatever is between them."""
        return [packet for packet, _ in self._vehicle.feed(received) if not self._is_answer_to_guard(packet)]

    def sends(self, packet: bytes) -> bool:
        """The guard sends one to the vehicle; whether the clients get it, too."""
        self._budget_bytes -= len(packet)
        message_id = message_id_of(packet)
        if message_id == _TIMESYNC:
            self._asked.append(fields_of(packet)["ts1"])
        return message_id in _FOR_PEOPLE

    def new_setpoint(self, now_us: int) -> Asked | None:
        """The latest of a client's since the one before; ten times a second at most."""
        if self._setpoint is None or now_us - self._told_us < TOLD_EVERY_US:
            return None
        setpoint, self._setpoint, self._told_us = self._setpoint, None, now_us
        return setpoint

    def _lets_pass(self, packet: bytes) -> bool:
        if not is_for(packet, self.system_id):
            return True
        self._setpoint = asked_by(packet) or self._setpoint
        if (self.is_closed or self.awaits_choice) and would_move(packet, self.autopilot):
            if self.is_closed or message_id_of(packet) in (*SETPOINT_IDS, *STICKS_IDS):
                self.kept_out += 1
                return False
            self.awaits_choice, self.has_chosen = False, True
        if (asked := interval_asked(packet)) is not None:
            self.intervals.append(asked)
        return True

    def _is_answer_to_guard(self, packet: bytes) -> bool:
        """A program would take it for one to its own question, by another clock."""
        if isinstance(packet, Stray) or message_id_of(packet) != _TIMESYNC:
            return False
        times = fields_of(packet)
        # A question says nothing of when it was answered.
        return times["tc1"] != 0 and times["ts1"] in self._asked


def _is_whole(data: bytes, start: int, length: int) -> bool:
    """Also one of another dialect, where a next one begins at its end. Its checksum is for the vehicle to check."""
    end = start + length
    return end == len(data) or data[end] in (MAGIC_V1, MAGIC_V2) or checksum_holds(data, start, length)
