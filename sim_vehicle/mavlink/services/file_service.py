"""FILE_TRANSFER_PROTOCOL: a server without files, so that clients which ask for one are told at once.

Source: MAVLink's file transfer protocol and PX4's mavlink/mavlink_ftp.cpp. PX4 keeps descriptions of itself and logs
there; this vehicle has none of either.
"""

import struct

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.mavlink.services.service import Board, Channel, Service

_HEADER = struct.Struct("<HBBBBBBI")
PAYLOAD_BYTES = 251

_RESET, _LIST = 2, 3
_ACK, _NAK = 128, 129
_END_OF_FILE, _NO_SUCH_FILE = 6, 10
_ROOT = (b"", b"/")


class FileService(Service):
    """Says that there is nothing."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self.handlers = {110: self._answer}

    def _answer(self, packet: dialect.MAVLink_file_transfer_protocol_message) -> None:
        asked = bytes(packet.payload)
        number, session, operation, size, *_ = _HEADER.unpack_from(asked)
        if operation >= _ACK:
            return
        # A list of the root is at its end, as after the last name of a folder; there is nothing to reset.
        lists_root = operation == _LIST and asked[_HEADER.size :][:size].rstrip(b"\0") in _ROOT
        why = b"" if operation == _RESET else bytes([_END_OF_FILE if lists_root else _NO_SUCH_FILE])
        answer = _HEADER.pack((number + 1) & 0xFFFF, session, _NAK if why else _ACK, len(why), operation, 0, 0, 0)
        payload = (answer + why).ljust(PAYLOAD_BYTES, b"\0")
        target = (packet.get_srcSystem(), packet.get_srcComponent())
        self._link.send(dialect.MAVLink_file_transfer_protocol_message(0, *target, payload))
