"""Messages that are no streams and come to whoever asks for them (REQUEST_MESSAGE).

Source: PX4's mavlink/streams/PROTOCOL_VERSION.hpp and AVAILABLE_MODES.hpp, and the answers of a running SITL.
"""

import struct
from collections.abc import Callable

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.mavlink.encode import Message

AVAILABLE_MODES_ID = 435
_NON_STANDARD = 0
# MAV_MODE_PROPERTY: all but altitude and position mode are called advanced; nobody chooses termination.
_ADVANCED, _NOT_SELECTABLE = 1, 2
_SIMPLE = (Mode.ALTCTL, Mode.POSCTL)
_LISTED = tuple(mode for mode in sorted(Mode) if mode is not Mode.DESCEND)


class ProtocolVersion(dialect.MAVLink_message):  # type: ignore[misc]
    """PROTOCOL_VERSION, which the dialect no longer has: MAVLink 2.0, and 1.0 understood; no hashes."""

    id = 300
    crc_extra = 217
    layout = struct.Struct("<HHH16x")
    versions = (200, 100, 200)

    def __init__(self) -> None:
        super().__init__(self.id, "PROTOCOL_VERSION")

    def pack(self, mav: dialect.MAVLink, force_mavlink1: bool = False) -> bytes:
        packet: bytes = self._pack(mav, self.crc_extra, self.layout.pack(*self.versions), force_mavlink1=force_mavlink1)
        return packet


def protocol_version(index: int) -> list[Message]:
    """Which MAVLink is spoken."""
    return [ProtocolVersion()]


def available_modes(index: int) -> list[Message]:
    """All modes for 0, else the one of that number; none for a number that there is not."""
    if index == 0:
        return [_available_mode(number, mode) for number, mode in enumerate(_LISTED, 1)]
    return [_available_mode(index, _LISTED[index - 1])] if 0 < index <= len(_LISTED) else []


def _available_mode(number: int, mode: Mode) -> Message:
    numbers = NUMBERS[mode]
    properties = 0 if mode in _SIMPLE else _ADVANCED
    if mode is Mode.TERMINATION:
        properties |= _NOT_SELECTABLE
    name = numbers.title if numbers.standard_mode == _NON_STANDARD else ""
    return dialect.MAVLink_available_modes_message(
        len(_LISTED), number, numbers.standard_mode, numbers.custom_mode, properties, name.encode()
    )


ANSWERS: dict[int, Callable[[int], list[Message]]] = {
    ProtocolVersion.id: protocol_version,
    AVAILABLE_MODES_ID: available_modes,
}
"""By message id; the argument is REQUEST_MESSAGE's second parameter."""
