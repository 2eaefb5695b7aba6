"""Mission packets to values. Partial lists have no reader: PX4 has no handler for them."""

from collections.abc import Callable

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_messages as wire
from sim_vehicle.autopilot.mission_protocol.mission_messages import Peer, WireItem


def _peer(packet: dialect.MAVLink_message) -> Peer:
    return Peer(packet.get_srcSystem(), packet.get_srcComponent())


def _request_list(packet: dialect.MAVLink_mission_request_list_message) -> wire.RequestList:
    return wire.RequestList(_peer(packet), packet.mission_type)


def _request(packet: dialect.MAVLink_mission_request_message) -> wire.RequestItem:
    return wire.RequestItem(_peer(packet), packet.seq, packet.mission_type, is_int=False)


def _request_int(packet: dialect.MAVLink_mission_request_int_message) -> wire.RequestItem:
    return wire.RequestItem(_peer(packet), packet.seq, packet.mission_type, is_int=True)


def _count(packet: dialect.MAVLink_mission_count_message) -> wire.Count:
    return wire.Count(_peer(packet), packet.count, packet.mission_type)


def _item(packet: dialect.MAVLink_mission_item_message) -> wire.Item:
    return wire.Item(_peer(packet), _wire_item(packet, is_int=False), packet.mission_type)


def _item_int(packet: dialect.MAVLink_mission_item_int_message) -> wire.Item:
    return wire.Item(_peer(packet), _wire_item(packet, is_int=True), packet.mission_type)


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


READERS: dict[int, Callable[[dialect.MAVLink_message], object | None]] = {
    39: _item,
    40: _request,
    41: _set_current,
    43: _request_list,
    44: _count,
    45: _clear_all,
    47: _ack,
    51: _request_int,
    73: _item_int,
}
