"""The mission protocol on one link: who may upload or download what, lost and repeated packets, time-outs.

Source: PX4's mavlink/mavlink_mission.cpp, without the words in which it turns something down. Partial lists
(MISSION_WRITE_PARTIAL_LIST, MISSION_REQUEST_PARTIAL_LIST) have no handler there and none here: they are not answered.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem
from sim_vehicle.autopilot.mission_protocol.mission_store import MOST_ITEMS
from sim_vehicle.mavlink.services import mission_wire as wire
from sim_vehicle.mavlink.services.mission_wire import MissionResult
from sim_vehicle.mavlink.services.service import Board, Channel, Service

# MAVLINK_MISSION_RETRY_TIMEOUT_DEFAULT and MAVLINK_MISSION_PROTOCOL_TIMEOUT_DEFAULT.
RETRY_US = 250_000
TIMEOUT_US = 5_000_000

_NOBODY = (0, 0)

Packet: TypeAlias = dialect.MAVLink_message

# Message ids. Items and requests for them are those with whole numbers; the older kind is not answered.
SET_CURRENT, REQUEST_LIST, COUNT, CLEAR_ALL, ACK, REQUEST_INT, ITEM_INT = MESSAGES = (41, 43, 44, 45, 47, 51, 73)


class TransferState(Enum):
    """What the link is doing."""

    IDLE = auto()
    RECEIVING = auto()
    """A list comes in: the vehicle asks for each item."""
    SENDING = auto()
    """A list goes out: the peer asks for each item."""


class MissionTransfer(Service):
    """Messages and the time in; answers out. The lists themselves are the store's."""

    def __init__(self, link: Channel, board: Board) -> None:
        self.handlers = dict.fromkeys(MESSAGES, self.receive)
        self.state = TransferState.IDLE
        self._store, self._link, self._send = board.autopilot.missions, link, link.send
        self._peer = _NOBODY
        self._type: int = MissionType.MISSION
        self._next = 0
        self._count = 0
        self._items: list[StoredItem] = []
        self._marked: int | None = None
        self._sent_us = 0
        self._heard_us = 0

    def receive(self, message: Packet) -> None:
        """Take a message that is addressed to this vehicle."""
        handler = _HANDLERS.get((message.id, self.state))
        if handler is not None:
            handler(self, message)

    def update(self, now_us: int) -> None:
        """Let time pass: repeats and time-outs."""
        if self.state is TransferState.IDLE:
            return
        if now_us - self._heard_us > TIMEOUT_US:
            self.end()
        elif now_us - self._sent_us > RETRY_US and self.state is TransferState.RECEIVING:
            self._ask_for_next()
        elif now_us - self._sent_us > RETRY_US and self._next == 0:
            self._send_count()

    def close(self) -> None:
        self.end()

    # --- download ----------------------------------------------------------------------------------------------

    def _begin_download(self, message: Packet) -> None:
        self.state, self._type, self._peer = TransferState.SENDING, message.mission_type, _peer(message)
        self._heard_us = self._link.now_us
        self._next, self._count = 0, len(self._store.plan(message.mission_type))
        self._send_count()

    def _begin_download_again(self, message: Packet) -> None:
        """A peer that has everything, or asks for the same once more, may begin again; others wait."""
        is_complete = self._next == len(self._store.plan(self._type))
        if is_complete or self._is_partners(message):
            self._begin_download(message)

    def _send_count(self) -> None:
        self._sent_us = self._link.now_us
        self._send(dialect.MAVLink_mission_count_message(*self._peer, self._count, self._type))

    def _send_item(self, message: Packet) -> None:
        if not self._is_partners(message):
            return
        self._heard_us = self._link.now_us
        number, items = message.seq, self._store.plan(self._type)
        is_next = number == self._next < self._count
        if is_next:
            self._next += 1
        if (is_next or number == self._next - 1) and number < len(items):
            self._sent_us = self._link.now_us
            around = (self._peer, number, self._store.current == number, self._type)
            self._send(wire.item_message(items[number], *around))
            return
        self.state = TransferState.IDLE
        self._acknowledge(MissionResult.ERROR)

    def _end_download(self, message: Packet) -> None:
        if self._is_partners(message):
            self.state = TransferState.IDLE

    # --- upload ------------------------------------------------------------------------------------------------

    def _begin_upload(self, message: Packet) -> None:
        self._heard_us = self._link.now_us
        if self._store.uploading:
            self._refuse(message)
            return
        self._peer, self._type = _peer(message), message.mission_type
        self._store.progress.reached = -1
        if message.count > MOST_ITEMS.get(message.mission_type, 0):
            self._acknowledge(MissionResult.NO_SPACE)
        elif message.count == 0:
            self._store.replace(message.mission_type, ())
            self._acknowledge(MissionResult.ACCEPTED)
        else:
            self.state, self._store.uploading = TransferState.RECEIVING, True
            self._next, self._count, self._marked = 0, message.count, None
            self._items = []
            self._ask_for_next()

    def _repeat_request(self, message: Packet) -> None:
        self._heard_us = self._link.now_us
        if _peer(message) == self._peer and self._next == 0:
            self._ask_for_next()
        else:
            self._refuse(message)

    def _refuse(self, message: Packet) -> None:
        """A transfer goes on that this would disturb."""
        self._acknowledge(MissionResult.ERROR, _peer(message))

    def _ask_for_next(self) -> None:
        self._sent_us = self._link.now_us
        self._send(dialect.MAVLink_mission_request_int_message(*self._peer, self._next, self._type))

    def _take_item(self, message: Packet) -> None:
        if _peer(message) != self._peer:
            return
        if message.mission_type != self._type:
            self._refuse(message)
            return
        self._heard_us = self._link.now_us
        if message.seq != self._next:
            return
        item = wire.parse(message)
        if isinstance(item, MissionResult):
            self.end(item)
            return
        if not wire.fits(item, self._type):
            self.end(MissionResult.ERROR)
            return
        self._items.append(item)
        if message.current:
            self._marked = message.seq
        self._next += 1
        if self._next < self._count:
            self._ask_for_next()
        else:
            self._store_list()

    def _store_list(self) -> None:
        # The same list once more changes nothing; compared as text, because a heading of NaN is the same then, too.
        if repr(tuple(self._items)) != repr(self._store.plan(self._type)):
            self._store.replace(self._type, tuple(self._items), self._marked)
        self.end(MissionResult.ACCEPTED)

    def _acknowledge_again(self, message: Packet) -> None:
        """After the last item: its sender may not have got our acknowledgement."""
        if _peer(message) == self._peer:
            is_last = message.mission_type == self._type and self._next == message.seq + 1
            self._acknowledge(MissionResult.ACCEPTED if is_last else MissionResult.ERROR)

    def _give_up(self, message: Packet) -> None:
        if _peer(message) == self._peer and message.type == MissionResult.CANCELLED:
            self.end()

    def end(self, result: MissionResult | None = None) -> None:
        """Of an upload the list is stored, or refused in whole; None: nobody is there to be told."""
        self._store.uploading = self._store.uploading and self.state is not TransferState.RECEIVING
        self.state = TransferState.IDLE
        if result is not None:
            self._acknowledge(result)

    # --- the rest ----------------------------------------------------------------------------------------------

    def _clear(self, message: Packet) -> None:
        self._type = message.mission_type
        kinds = MOST_ITEMS if message.mission_type == MissionType.ALL else [message.mission_type]
        for kind in kinds:
            self._store.replace(kind, (), 0)
        self._acknowledge(MissionResult.ACCEPTED, _peer(message))

    def _set_current(self, message: Packet) -> None:
        self._store.choose(message.seq)

    def _acknowledge(self, result: MissionResult, peer: tuple[int, int] | None = None) -> None:
        """To the partner of the last transfer, or to another."""
        self._send(dialect.MAVLink_mission_ack_message(*(peer or self._peer), result, self._type))

    def _is_partners(self, message: Packet) -> bool:
        return message.mission_type == self._type and _peer(message) == self._peer


def _peer(packet: Packet) -> tuple[int, int]:
    return packet.get_srcSystem(), packet.get_srcComponent()


# The table: what a message means in each state; what is not in it is passed over.
_M = MissionTransfer
_HANDLERS: dict[tuple[int, TransferState], Callable[[Any, Any], None]] = {
    (REQUEST_LIST, TransferState.IDLE): _M._begin_download,
    (COUNT, TransferState.IDLE): _M._begin_upload,
    (ITEM_INT, TransferState.IDLE): _M._acknowledge_again,
    (CLEAR_ALL, TransferState.IDLE): _M._clear,
    (SET_CURRENT, TransferState.IDLE): _M._set_current,
    (REQUEST_LIST, TransferState.SENDING): _M._begin_download_again,
    (REQUEST_INT, TransferState.SENDING): _M._send_item,
    (COUNT, TransferState.SENDING): _M._refuse,
    (ITEM_INT, TransferState.SENDING): _M._refuse,
    (ACK, TransferState.SENDING): _M._end_download,
    (COUNT, TransferState.RECEIVING): _M._repeat_request,
    (ITEM_INT, TransferState.RECEIVING): _M._take_item,
    (ACK, TransferState.RECEIVING): _M._give_up,
}
