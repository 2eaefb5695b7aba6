"""Packets of a vehicle whose clock has jumped: the same, with other time stamps."""

from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.errors import FaultError
from sim_vehicle.faults.spec import Fault, WireFault

# Times since boot, by field and its unit in microseconds.
_STAMPS_US = {"time_boot_ms": 1000, "time_usec": 1}
# The narrow ones wrap as the vehicle's own counters would; SERVO_OUTPUT_RAW counts microseconds in 32 bits.
_MASKS = {"uint32_t": 0xFFFFFFFF, "uint64_t": 0xFFFFFFFFFFFFFFFF}
_SIGNED = 0x01


class Restamper:
    """Adds an offset to every time stamp that packets carry of the vehicle's clock."""

    def __init__(self) -> None:
        self._link = dialect.MAVLink(None)

    def restamp(self, frame: bytes, offset_us: int) -> bytes:
        """The packet with its stamps moved; as it was if it has none, is signed or is damaged."""
        if len(frame) < 3 or (frame[0] == 0xFD and frame[2] & _SIGNED):
            return frame
        try:
            message = self._link.decode(bytearray(frame))
        except dialect.MAVError:
            return frame
        changed = self._move(message, offset_us)
        if not changed:
            return frame
        link = self._link
        link.seq, link.srcSystem, link.srcComponent = (
            message.get_seq(),
            message.get_srcSystem(),
            message.get_srcComponent(),
        )
        packed: bytes = message.pack(link, force_mavlink1=frame[0] == 0xFE)
        return packed

    def _move(self, message: Any, offset_us: int) -> bool:
        changed, name = False, message.get_type()
        if name == "PING" and message.target_system:
            # An answer carries the asker's time.
            return False
        for field, unit_us in _STAMPS_US.items():
            value = getattr(message, field, None)
            if value is not None:
                mask = _MASKS[message.fieldtypes[message.fieldnames.index(field)]]
                setattr(message, field, (value + offset_us // unit_us) & mask)
                changed = True
        if name == "TIMESYNC":
            # An answer has the vehicle's time in tc1, a request of its own in ts1.
            field = "tc1" if message.tc1 else "ts1"
            setattr(message, field, getattr(message, field) + 1000 * offset_us)
            changed = True
        return changed


def message_number(name: str) -> int:
    """The number of a message by its name; raises FaultError where there is none."""
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name.upper()}", None)
    if number is None:
        raise FaultError(f"no MAVLink message is called {name!r}.")
    return int(number)


def check_messages(fault: Fault) -> None:
    """Raise FaultError if a fault of the wire names a message that there is not."""
    for message in fault.messages if isinstance(fault, WireFault) else ():
        if isinstance(message, str):
            message_number(message)
