"""The parameter protocol: list, read, set.

Source: PX4's mavlink/mavlink_parameters.cpp. What is wrong (a name, an index, a type) is not answered. There is no
_HASH_CHECK, which spares a ground station a list that it has kept.
"""

import struct

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.faults.wire import MAVLINK_2
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.framing import Layout
from sim_vehicle.mavlink.services.service import Board, Channel, Service
from sim_vehicle.parameters.store import Parameters

_FLOAT, _WHOLE = struct.Struct("<f"), struct.Struct("<i")
_PARAM_VALUE = Layout(dialect.MAVLink_param_value_message)
# Its payload. A whole number's four bytes are its own: no Python float carries all of them unchanged.
_FLOAT_VALUE, _WHOLE_VALUE = struct.Struct("<fHH16sB"), struct.Struct("<iHH16sB")
# PARAM_SET's value comes first after the header, of MAVLink 2 and 1.
_HEADER_V2, _HEADER_V1 = 10, 6
_IS_WHOLE = {dialect.MAV_PARAM_TYPE_INT32: True, dialect.MAV_PARAM_TYPE_REAL32: False}

# PX4 sends so many of a list at a time where the link is fast.
BURST = 20
# A changed value is told to everybody this long after it was set, whoever set it.
ANNOUNCE_AFTER_US = 5_000


class ParameterService(Service):
    """The vehicle's parameters on one link."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._us = board.identity
        self._parameters = parameters = board.autopilot.parameters
        self._names = parameters.names
        self._index = {name: number for number, name in enumerate(self._names)}
        self._next: int | None = None
        """Index of what is sent next of a list; None while none is sent."""
        self._told = parameters.sets
        self._announce_at_us: int | None = None
        self.handlers = {20: self._read, 21: self._list, 23: self._set}

    def update(self, now_us: int) -> None:
        """Go on with the list; tell of what has changed."""
        if self._next is not None:
            self._send_burst()
        if self._parameters.sets != self._told:
            self._announce(now_us)

    def _list(self, packet: dialect.MAVLink_param_request_list_message) -> None:
        if packet.target_system == self._us.system:
            self._next = 0

    def _read(self, packet: dialect.MAVLink_param_request_read_message) -> None:
        if packet.target_system != self._us.system:
            return
        if packet.param_index >= 0:
            if packet.param_index < len(self._names):
                self._send(self._names[packet.param_index])
        elif packet.param_id in self._index:
            self._send(packet.param_id)

    def _set(self, packet: dialect.MAVLink_param_set_message) -> None:
        if packet.target_system != self._us.system:
            return
        definition, is_whole = self._parameters.definitions.get(packet.param_id), _IS_WHOLE.get(packet.param_type)
        if definition is None or is_whole is not definition.is_whole:
            return
        # From the bytes: as a Python float some whole numbers would come back changed (signalling NaNs).
        raw = packet.get_msgbuf()
        begin = _HEADER_V2 if raw[0] == MAVLINK_2 else _HEADER_V1
        (value,) = (_WHOLE if is_whole else _FLOAT).unpack_from(raw, begin)
        self._parameters.set(packet.param_id, value)
        self._send(packet.param_id)

    def _send_burst(self) -> None:
        for _ in range(BURST):
            if self._next is None:
                return
            self._send(self._names[self._next])
            self._next = self._next + 1 if self._next + 1 < len(self._names) else None

    def _announce(self, now_us: int) -> None:
        if self._announce_at_us is None:
            self._announce_at_us = now_us + ANNOUNCE_AFTER_US
        if now_us < self._announce_at_us:
            return
        for name in self._parameters.set_after(self._told):
            self._send(name)
        self._told, self._announce_at_us = self._parameters.sets, None

    def _send(self, name: str) -> None:
        self._link.send(_parameter_value(self._parameters, name, self._index[name]))


def _parameter_value(parameters: Parameters, name: str, index: int) -> Message:
    is_whole = parameters.definitions[name].is_whole
    kind = dialect.MAV_PARAM_TYPE_INT32 if is_whole else dialect.MAV_PARAM_TYPE_REAL32
    fields = (parameters.stored(name), len(parameters.names), index, name.encode(), kind)
    return _PARAM_VALUE, (_WHOLE_VALUE if is_whole else _FLOAT_VALUE).pack(*fields)
