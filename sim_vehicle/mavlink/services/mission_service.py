"""The mission protocol on a link, and the mission's progress."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol import mission_messages as wire
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionAnswer, MissionMessage
from sim_vehicle.autopilot.mission_protocol.mission_progress import ProgressReport
from sim_vehicle.autopilot.mission_protocol.mission_transfer import MissionTransfer, State
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.service import Handler

if TYPE_CHECKING:
    from sim_vehicle.mavlink.link import Link

_INT_FRAME = {kinds.FRAME_GLOBAL: kinds.FRAME_GLOBAL_INT, kinds.FRAME_GLOBAL_RELATIVE: kinds.FRAME_GLOBAL_RELATIVE_INT}
_FLOAT_FRAME = {number: frame for frame, number in _INT_FRAME.items()}
_KINDS = (wire.RequestList, wire.RequestItem, wire.Count, wire.Item, wire.Ack, wire.ClearAll, wire.SetCurrent)


class MissionService:
    """One link's transfer; the lists are the autopilot's."""

    def __init__(self, link: "Link", board: Board) -> None:
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
        if self._transfer.state is not State.IDLE:
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
