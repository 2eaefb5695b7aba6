"""The mission protocol on a link, read, answered and sent, and the mission's progress."""

from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol import mission_messages as wire
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionAnswer, MissionMessage, MissionPeer, WireItem
from sim_vehicle.autopilot.mission_protocol.mission_progress import ProgressReport
from sim_vehicle.autopilot.mission_protocol.mission_transfer import MissionTransfer, TransferState
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.service import Channel, Handler


def _peer(packet: dialect.MAVLink_message) -> MissionPeer:
    return MissionPeer(packet.get_srcSystem(), packet.get_srcComponent())


def _request_list(packet: dialect.MAVLink_mission_request_list_message) -> wire.RequestList:
    return wire.RequestList(_peer(packet), packet.mission_type)


def _request(packet: dialect.MAVLink_mission_request_message) -> wire.RequestItem:
    return wire.RequestItem(_peer(packet), packet.seq, packet.mission_type, is_int=False)


def _request_int(packet: dialect.MAVLink_mission_request_int_message) -> wire.RequestItem:
    return wire.RequestItem(_peer(packet), packet.seq, packet.mission_type, is_int=True)


def _count(packet: dialect.MAVLink_mission_count_message) -> wire.Count:
    return wire.Count(_peer(packet), packet.count, packet.mission_type)


def _read_item(packet: dialect.MAVLink_mission_item_message) -> wire.SentItem:
    return wire.SentItem(_peer(packet), _wire_item(packet, is_int=False), packet.mission_type)


def _read_item_int(packet: dialect.MAVLink_mission_item_int_message) -> wire.SentItem:
    return wire.SentItem(_peer(packet), _wire_item(packet, is_int=True), packet.mission_type)


def _wire_item(
    packet: dialect.MAVLink_mission_item_message | dialect.MAVLink_mission_item_int_message, is_int: bool
) -> WireItem:
    return WireItem(
        number=packet.seq,
        frame=packet.frame,
        command=packet.command,
        current=bool(packet.current),
        autocontinue=packet.autocontinue,
        params=(packet.param1, packet.param2, packet.param3, packet.param4),
        x=packet.x,
        y=packet.y,
        z=packet.z,
        is_int=is_int,
    )


def _ack(packet: dialect.MAVLink_mission_ack_message) -> wire.Ack:
    return wire.Ack(_peer(packet), packet.type, packet.mission_type)


def _clear_all(packet: dialect.MAVLink_mission_clear_all_message) -> wire.ClearAll:
    return wire.ClearAll(_peer(packet), packet.mission_type)


def _set_current(packet: dialect.MAVLink_mission_set_current_message) -> wire.SetCurrent:
    return wire.SetCurrent(_peer(packet), packet.seq)


# Partial lists have no reader: PX4 has no handler for them.
READERS: dict[int, Callable[[dialect.MAVLink_message], object | None]] = {
    39: _read_item,
    40: _request,
    41: _set_current,
    43: _request_list,
    44: _count,
    45: _clear_all,
    47: _ack,
    51: _request_int,
    73: _read_item_int,
}


_INT_FRAME = {kinds.FRAME_GLOBAL: kinds.FRAME_GLOBAL_INT, kinds.FRAME_GLOBAL_RELATIVE: kinds.FRAME_GLOBAL_RELATIVE_INT}
_FLOAT_FRAME = {number: frame for frame, number in _INT_FRAME.items()}
_KINDS = (wire.RequestList, wire.RequestItem, wire.Count, wire.SentItem, wire.Ack, wire.ClearAll, wire.SetCurrent)


class MissionService:
    """One link's transfer; the lists are the autopilot's."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._autopilot = board.autopilot
        self._transfer = MissionTransfer(board.autopilot.missions)
        self._report = ProgressReport(board.autopilot.missions)

    @property
    def handlers(self) -> Mapping[type, Handler]:
        """All that the protocol has."""
        return dict.fromkeys(_KINDS, self._receive)

    def update(self, now_us: int) -> None:
        """Repeats, time-outs, and what the mission has come to."""
        for answer in self._report.update(now_us):
            self._link.send(message_of(answer))
        if self._transfer.state is not TransferState.IDLE:
            for answer in self._transfer.update(now_us):
                self._link.send(message_of(answer))
            self._say()

    def _receive(self, message: MissionMessage) -> None:
        for answer in self._transfer.receive(message, self._link.now_us):
            self._link.send(message_of(answer))
        self._say()

    def _say(self) -> None:
        if self._transfer.texts:
            self._autopilot.texts += self._transfer.texts
            self._transfer.texts.clear()


def message_of(answer: MissionAnswer) -> Message:
    """The packet's content."""
    if isinstance(answer, wire.SendItem):
        return _item(answer)
    if isinstance(answer, wire.SendCurrent):
        return dialect.MAVLink_mission_current_message(answer.number, answer.total, answer.state, answer.mode)
    if isinstance(answer, wire.SendReached):
        return dialect.MAVLink_mission_item_reached_message(answer.number)
    to = (answer.peer.system, answer.peer.component)
    if isinstance(answer, wire.SendCount):
        return dialect.MAVLink_mission_count_message(*to, answer.count, answer.type)
    if isinstance(answer, wire.SendAck):
        return dialect.MAVLink_mission_ack_message(*to, answer.result, answer.type)
    if answer.is_int:
        return dialect.MAVLink_mission_request_int_message(*to, answer.number, answer.type)
    return dialect.MAVLink_mission_request_message(*to, answer.number, answer.type)


def _item(answer: wire.SendItem) -> Message:
    item, to = answer.item, (answer.peer.system, answer.peer.component)
    *params, x, y, z = item.params
    around = (item.command, int(answer.is_current), item.autocontinue)
    if not answer.is_int:
        frame = _FLOAT_FRAME.get(item.frame, item.frame)
        return dialect.MAVLink_mission_item_message(*to, answer.number, frame, *around, *params, x, y, z, answer.type)
    scale = 1 if item.frame == kinds.FRAME_MISSION else 1e7
    frame = _INT_FRAME.get(item.frame, item.frame)
    place = (round(x * scale), round(y * scale))
    return dialect.MAVLink_mission_item_int_message(*to, answer.number, frame, *around, *params, *place, z, answer.type)
