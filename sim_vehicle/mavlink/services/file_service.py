"""FILE_TRANSFER_PROTOCOL: a server without files, so that clients which ask for one are told at once.

Source: MAVLink's file transfer protocol and PX4's mavlink/mavlink_ftp.cpp. PX4 keeps descriptions of itself and logs
there; this vehicle has none of either.
"""

import struct

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.mavlink.services.service import Board, Channel, Service

_HEADER = struct.Struct("<HBBBBBBI")
PAYLOAD_BYTES = 251

_RESET, _LIST, _OPEN, _CRC, _BURST_READ = 2, 3, 4, 14, 15
_ACK, _NAK = 128, 129
_NO_SESSION, _END_OF_FILE, _UNKNOWN_COMMAND, _PROTECTED, _NO_SUCH_FILE = 4, 6, 7, 9, 10
# What ends, reads or writes a session that cannot be there; what names a file that is not; what would make one.
_REFUSALS = {
    **dict.fromkeys((1, 5, 7, _BURST_READ), _NO_SESSION),
    **dict.fromkeys((_LIST, _OPEN, 8, 10, 12, 13, _CRC), _NO_SUCH_FILE),
    **dict.fromkeys((6, 9, 11), _PROTECTED),
}
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
        next_number = (number + 1) & 0xFFFF
        if operation == _RESET:
            answer = _HEADER.pack(next_number, session, _ACK, 0, operation, 0, 0, 0)
        else:
            why = _REFUSALS.get(operation, _UNKNOWN_COMMAND)
            if operation == _LIST and asked[_HEADER.size :][:size].rstrip(b"\0") in _ROOT:
                # As after the last name of a folder
                why = _END_OF_FILE
            answer = _HEADER.pack(next_number, session, _NAK, 1, operation, 0, 0, 0) + bytes([why])
        payload = answer.ljust(PAYLOAD_BYTES, b"\0")
        target = (packet.get_srcSystem(), packet.get_srcComponent())
        self._link.send(dialect.MAVLink_file_transfer_protocol_message(0, *target, payload))
