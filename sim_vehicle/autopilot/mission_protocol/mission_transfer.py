"""The mission protocol on one link: who may upload or download what, lost and repeated packets, time-outs.

Source: PX4's mavlink/mavlink_mission.cpp. Partial lists (MISSION_WRITE_PARTIAL_LIST, MISSION_REQUEST_PARTIAL_LIST) have
no handler there and none here: they are not answered.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import Any

from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.autopilot.mission_protocol import mission_items
from sim_vehicle.autopilot.mission_protocol import mission_messages as wire
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionResult, MissionType, StoredItem
from sim_vehicle.autopilot.mission_protocol.mission_store import MOST_ITEMS, MissionStore, Plan

# MAVLINK_MISSION_RETRY_TIMEOUT_DEFAULT and MAVLINK_MISSION_PROTOCOL_TIMEOUT_DEFAULT.
RETRY_US = 250_000
TIMEOUT_US = 5_000_000

_NOBODY = wire.MissionPeer(0, 0)
_NO_CLEAR, _NO_CURRENT = "WPM: IGN CLEAR CMD: Busy", "WPM: IGN WP CURR CMD: Busy"
_DOWNLOAD_RUNS = "Mission download request ignored, already active"


class TransferState(Enum):
    """What the link is doing."""

    IDLE = auto()
    RECEIVING = auto()
    """A list comes in: the vehicle asks for each item."""
    SENDING = auto()
    """A list goes out: the peer asks for each item."""


class MissionTransfer:
    """Messages and the time in; answers and texts out. The lists themselves are the store's."""

    def __init__(self, store: MissionStore) -> None:
        self.state = TransferState.IDLE
        self.texts: list[StatusText] = []
        self._store = store
        self._answers: list[wire.MissionAnswer] = []
        self._now_us = 0
        self._peer = _NOBODY
        self._type: int = MissionType.MISSION
        self._is_int = True
        self._next = 0
        self._count = 0
        self._items: list[StoredItem] = []
        self._marked: int | None = None
        self._checksum = 0
        self._sent_us: int | None = None
        self._heard_us: int | None = None

    def receive(self, message: wire.MissionMessage, now_us: int) -> list[wire.MissionAnswer]:
        """Take a message that is addressed to this vehicle."""
        self._now_us = now_us
        _HANDLERS[type(message), self.state](self, message)
        return self._taken()

    def update(self, now_us: int) -> list[wire.MissionAnswer]:
        """Let time pass: repeats and time-outs."""
        self._now_us = now_us
        if self.state is not TransferState.IDLE:
            self._wait()
        return self._taken()

    def _taken(self) -> list[wire.MissionAnswer]:
        answers, self._answers = self._answers, []
        return answers

    # --- time ------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        now_us = self._now_us
        is_quiet = self._sent_us is not None and now_us - self._sent_us > RETRY_US
        if self.state is TransferState.RECEIVING and is_quiet and not self._is_over():
            self._ask_for_next()
        elif self.state is TransferState.SENDING and is_quiet and self._next == 0 and not self._is_over():
            self._send_count()
        elif self._is_over():
            self._say("Mission sync timeout")
            self._end_upload()

    def _is_over(self) -> bool:
        return self._heard_us is not None and self._now_us - self._heard_us > TIMEOUT_US

    # --- download ----------------------------------------------------------------------------------------------

    def _begin_download(self, message: wire.RequestList) -> None:
        self.state, self._type, self._peer = TransferState.SENDING, message.type, message.peer
        self._heard_us = self._now_us
        self._next, self._count = 0, len(self._store.plan(message.type).items)
        self._send_count()

    def _begin_download_again(self, message: wire.RequestList) -> None:
        """A peer that has everything, or asks for the same once more, may begin again; others wait."""
        is_complete = self._next == len(self._store.plan(self._type).items)
        if is_complete or (self._type == message.type and message.peer == self._peer):
            self._begin_download(message)
        else:
            self._say(_DOWNLOAD_RUNS, Severity.INFO)

    def _send_count(self) -> None:
        self._sent_us = self._now_us
        self._answers.append(wire.SendCount(self._peer, self._count, self._type))

    def _send_item(self, message: wire.RequestItem) -> None:
        if message.peer != self._peer:
            self._say("WPM: REJ. CMD: partner id mismatch")
            return
        self._is_int = message.is_int
        if message.type != self._type:
            return
        self._heard_us = self._now_us
        number, items = message.number, self._store.plan(self._type).items
        is_next = number == self._next < self._count
        if is_next:
            self._next += 1
        if (is_next or number == self._next - 1) and number < len(items):
            self._sent_us = self._now_us
            is_current = self._store.current == number
            self._answers.append(wire.SendItem(self._peer, number, items[number], is_current, self._type, self._is_int))
            return
        self.state = TransferState.IDLE
        self._acknowledge(MissionResult.ERROR)
        self._say("WPM: REJ. CMD: Req. WP was unexpected")

    def _ignore_request(self, message: wire.RequestItem) -> None:
        self._is_int = message.is_int
        if message.peer != self._peer:
            self._say("WPM: REJ. CMD: partner id mismatch")

    def _refuse_request(self, message: wire.RequestItem) -> None:
        self._is_int = message.is_int
        self._say("WPM: REJ. CMD: " + ("Busy" if message.peer == self._peer else "partner id mismatch"))

    def _end_download(self, message: wire.Ack) -> None:
        if message.peer != self._peer:
            self._say("REJ. WP CMD: partner id mismatch")
        elif message.type == self._type:
            self._heard_us = self._now_us
            self.state = TransferState.IDLE

    # --- upload ------------------------------------------------------------------------------------------------

    def _begin_upload(self, message: wire.Count) -> None:
        self._heard_us = self._now_us
        if self._store.uploading:
            self._answers.append(wire.SendAck(message.peer, MissionResult.ERROR, self._type))
            return
        self._peer, self._type, self._checksum = message.peer, message.type, 0
        self._store.progress.reached = -1
        if message.type not in MOST_ITEMS:
            self._acknowledge(MissionResult.NO_SPACE if message.count else MissionResult.ACCEPTED)
        elif message.count > MOST_ITEMS[MissionType(message.type)]:
            self._acknowledge(MissionResult.NO_SPACE)
        elif message.count == 0:
            self._store.replace(MissionType(message.type), Plan())
            self._acknowledge(MissionResult.ACCEPTED)
        else:
            self.state, self._store.uploading = TransferState.RECEIVING, True
            self._next, self._count, self._marked = 0, message.count, None
            self._items = []
            self._ask_for_next()

    def _repeat_request(self, message: wire.Count) -> None:
        self._heard_us = self._now_us
        if message.peer != self._peer:
            self._answers.append(wire.SendAck(message.peer, MissionResult.ERROR, self._type))
        elif self._next == 0:
            self._ask_for_next()
        else:
            self._say("WPM: REJ. CMD: Busy")
            self._acknowledge(MissionResult.ERROR)

    def _refuse_upload(self, message: wire.Count) -> None:
        self._say("WPM: IGN MISSION_COUNT: Busy")
        self._answers.append(wire.SendAck(message.peer, MissionResult.ERROR, self._type))

    def _ask_for_next(self) -> None:
        self._sent_us = self._now_us
        self._answers.append(wire.SendRequest(self._peer, self._next, self._type, self._is_int))

    def _take_item(self, message: wire.SentItem) -> None:
        if not self._is_from_partner(message):
            return
        self._heard_us = self._now_us
        if message.item.number != self._next:
            return
        item = mission_items.parse(message.item)
        if isinstance(item, MissionResult):
            self._say("IGN MISSION_ITEM: Invalid item")
            self._refuse_list(item)
            return
        if not mission_items.fits(item, self._type):
            self._refuse_list(MissionResult.ERROR)
            return
        self._checksum = message.item.checksum(self._checksum)
        self._items.append(item)
        if message.item.current:
            self._marked = message.item.number
        self._next += 1
        if self._next < self._count:
            self._ask_for_next()
        else:
            self._store_list()

    def _store_list(self) -> None:
        if self._checksum != self._store.plan(self._type).checksum:
            plan = Plan(tuple(self._items), self._checksum)
            self._store.replace(MissionType(self._type), plan, self._marked)
        self._end_upload()
        self._acknowledge(MissionResult.ACCEPTED)

    def _acknowledge_again(self, message: wire.SentItem) -> None:
        """After the last item: its sender may not have got our acknowledgement."""
        if not self._is_from_partner(message):
            return
        if self._next == message.item.number + 1:
            self._acknowledge(MissionResult.ACCEPTED)
        else:
            self._say("IGN MISSION_ITEM: No transfer")
            self._acknowledge(MissionResult.ERROR)

    def _refuse_item(self, message: wire.SentItem) -> None:
        if self._is_from_partner(message):
            self._say("IGN MISSION_ITEM: Busy")
            self._acknowledge(MissionResult.ERROR)

    def _is_from_partner(self, message: wire.SentItem) -> bool:
        self._is_int = message.item.is_int
        if message.peer != self._peer:
            self._say("REJ. MIS ITEM: partner id mismatch")
            return False
        if message.type != self._type:
            self._acknowledge(MissionResult.ERROR)
            return False
        return True

    def _refuse_list(self, result: MissionResult) -> None:
        self._acknowledge(result)
        self._end_upload()

    def _end_upload(self) -> None:
        self._store.uploading = self._store.uploading and self.state is not TransferState.RECEIVING
        self.state = TransferState.IDLE

    def _answer_upload(self, message: wire.Ack) -> None:
        """The peer cannot send items of the other kind, or gives up."""
        if message.peer != self._peer:
            self._say("REJ. WP CMD: partner id mismatch")
        elif message.result == MissionResult.UNSUPPORTED:
            self._is_int = not self._is_int
            self._ask_for_next()
        elif message.result == MissionResult.CANCELLED:
            self._end_upload()

    # --- the rest ----------------------------------------------------------------------------------------------

    def _clear(self, message: wire.ClearAll) -> None:
        self._heard_us, self._type = self._now_us, message.type
        kinds = MOST_ITEMS if message.type == MissionType.ALL else [message.type]
        for kind in kinds:
            if kind in MOST_ITEMS:
                self._store.replace(MissionType(kind), Plan(), 0)
        self._answers.append(wire.SendAck(message.peer, MissionResult.ACCEPTED, self._type))

    def _set_current(self, message: wire.SetCurrent) -> None:
        if not self._store.choose(message.number):
            self._say("WPM: WP CURR CMD: Not in list")

    def _ignore_ack(self, message: wire.Ack) -> None:
        if message.peer != self._peer:
            self._say("REJ. WP CMD: partner id mismatch")

    def _acknowledge(self, result: MissionResult) -> None:
        self._answers.append(wire.SendAck(self._peer, result, self._type))

    def _say(self, text: str, severity: Severity = Severity.CRITICAL) -> None:
        self.texts.append(StatusText(severity, text))


def _refused(text: str, severity: Severity = Severity.CRITICAL) -> Callable[[MissionTransfer, Any], None]:
    return lambda transfer, message: transfer.texts.append(StatusText(severity, text))


# The table: what a message means in each state.
_M = MissionTransfer
_HANDLERS: dict[tuple[type, TransferState], Callable[[Any, Any], None]] = {
    (wire.RequestList, TransferState.IDLE): _M._begin_download,
    (wire.RequestList, TransferState.SENDING): _M._begin_download_again,
    (wire.RequestList, TransferState.RECEIVING): _refused(_DOWNLOAD_RUNS, Severity.INFO),
    (wire.RequestItem, TransferState.IDLE): _M._ignore_request,
    (wire.RequestItem, TransferState.SENDING): _M._send_item,
    (wire.RequestItem, TransferState.RECEIVING): _M._refuse_request,
    (wire.Count, TransferState.IDLE): _M._begin_upload,
    (wire.Count, TransferState.SENDING): _M._refuse_upload,
    (wire.Count, TransferState.RECEIVING): _M._repeat_request,
    (wire.SentItem, TransferState.IDLE): _M._acknowledge_again,
    (wire.SentItem, TransferState.SENDING): _M._refuse_item,
    (wire.SentItem, TransferState.RECEIVING): _M._take_item,
    (wire.Ack, TransferState.IDLE): _M._ignore_ack,
    (wire.Ack, TransferState.SENDING): _M._end_download,
    (wire.Ack, TransferState.RECEIVING): _M._answer_upload,
    (wire.ClearAll, TransferState.IDLE): _M._clear,
    (wire.ClearAll, TransferState.SENDING): _refused(_NO_CLEAR),
    (wire.ClearAll, TransferState.RECEIVING): _refused(_NO_CLEAR),
    (wire.SetCurrent, TransferState.IDLE): _M._set_current,
    (wire.SetCurrent, TransferState.SENDING): _refused(_NO_CURRENT),
    (wire.SetCurrent, TransferState.RECEIVING): _refused(_NO_CURRENT),
}
