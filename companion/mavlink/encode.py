"""Typed commands to MAVLink 2 bytes. Sequence numbers, type masks and NaN exist only here."""

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion import messages
from companion.autopilot.interface import Autopilot
from companion.autopilot.known import ASSUMED
from companion.messages import AttitudeSetpoint, ComputerStatus, Outgoing, PositionSetpoint, SendCommand, StatusText

COMPONENT_ID = dialect.MAV_COMP_ID_ONBOARD_COMPUTER
# Before the vehicle is known: PX4's own default MAV_SYS_ID.
DEFAULT_SYSTEM_ID = 1

# POSITION_TARGET_TYPEMASK: a set bit tells the vehicle to ignore the part.
IGNORE_POSITION = 0x007
IGNORE_VELOCITY = 0x038
IGNORE_ACCELERATION = 0x1C0
IGNORE_YAW = 0x400
IGNORE_YAW_RATE = 0x800

NAN = math.nan
NOT_GIVEN = (NAN, NAN, NAN)

# ONBOARD_COMPUTER_STATUS: the largest number of a field says that it is not used.
_UNUSED_INT8, _UNUSED_UINT8, _UNUSED_INT16, _UNUSED_UINT32 = 0x7F, 0xFF, 0x7FFF, 0xFFFFFFFF
_CORES = 8
_REAL = dialect.MAV_PARAM_TYPE_REAL32

# STATUSTEXT's field.
TEXT_LENGTH = 50


class Encoder:
    """Counts the packets it makes; otherwise without memory."""

    def __init__(self) -> None:
        self._mavlink = dialect.MAVLink(None, DEFAULT_SYSTEM_ID, COMPONENT_ID)
        self._text_number, self._autopilot = 0, ASSUMED
        self._target = (DEFAULT_SYSTEM_ID, dialect.MAV_COMP_ID_AUTOPILOT1)

    def speak_to(self, system_id: int, component_id: int, autopilot: Autopilot = ASSUMED) -> None:
        """Address the vehicle, and become a component of its system."""
        self._autopilot = autopilot
        self._mavlink.srcSystem = system_id
        self._target = (system_id, component_id)

    def packets(self, outgoing: Outgoing) -> list[bytes]:
        """All that it takes; of most messages one."""
        messages = self._chunks(outgoing) if isinstance(outgoing, StatusText) else [self._message(outgoing)]
        return [self._pack(message) for message in messages]

    def unsent(self, outgoing: Outgoing) -> bytes:
        """The packets, which do not count as long as they are not sent."""
        seq = self._mavlink.seq
        packets = b"".join(self.packets(outgoing))
        self._mavlink.seq = seq
        return packets

    def _pack(self, message: Any) -> bytes:
        packet = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        return packet

    def _chunks(self, status: StatusText) -> list[Any]:
        """A text that fits has no number; the parts of one that does not share theirs, never 0 (the message's spec)."""
        text = status.text.encode()
        parts = [text[start : start + TEXT_LENGTH] for start in range(0, len(text), TEXT_LENGTH)] or [b""]
        number = 0
        if len(parts) > 1:
            self._text_number = number = self._text_number % 0xFFFF + 1
            # the last part ends the text by being shorter than the field
            parts += [b""] if len(parts[-1]) == TEXT_LENGTH else []
        return [
            dialect.MAVLink_statustext_message(status.severity, part, number, sequence)
            for sequence, part in enumerate(parts)
        ]

    def _message(self, outgoing: Outgoing) -> Any:
        match outgoing:
            case PositionSetpoint():
                return self._position(outgoing)
            case AttitudeSetpoint(time_us, attitude_wxyz, thrust_fraction, yaw_rate_rad_s):
                head = (_time_ms(time_us), *self._target, self._autopilot.attitude_mask)
                motion = (list(attitude_wxyz), 0.0, 0.0, yaw_rate_rad_s)
                return dialect.MAVLink_set_attitude_target_message(*head, *motion, thrust_fraction)
            case SendCommand(command, confirmation):
                parameters = (*command.parameters, *(0.0,) * (7 - len(command.parameters)))
                head = (*self._target, command.command_id, confirmation)
                return dialect.MAVLink_command_long_message(*head, *parameters)
            case messages.OnboardHeartbeat(active):
                status = dialect.MAV_STATE_ACTIVE if active else dialect.MAV_STATE_STANDBY
                return dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, status, 3
                )
            case messages.NamedValue(time_us, name, tuple(vector)):
                return dialect.MAVLink_debug_vect_message(name.encode(), time_us, *vector)
            case messages.NamedValue(time_us, name, value):
                return dialect.MAVLink_named_value_float_message(_time_ms(time_us), name.encode(), value)
            case ComputerStatus():
                return _computer(outgoing)
            case messages.TimeSync(asked_ns, answered_ns):
                return dialect.MAVLink_timesync_message(answered_ns or 0, asked_ns)
            case messages.ReadParameter(name):
                return dialect.MAVLink_param_request_read_message(*self._target, name.encode(), -1)
            case messages.Parameter(name, value):
                told = (float(value), _REAL) if self._autopilot.casts_whole_numbers else _as_float(value)
                return dialect.MAVLink_param_set_message(*self._target, name.encode(), *told)

    def _position(self, setpoint: PositionSetpoint) -> Any:
        velocity, acceleration = setpoint.velocity_ned_m_s, setpoint.acceleration_ned_m_s2
        type_mask, yaw = IGNORE_YAW_RATE, NAN if setpoint.yaw_rad is None else setpoint.yaw_rad
        type_mask |= IGNORE_VELOCITY if velocity is None else 0
        type_mask |= IGNORE_ACCELERATION if acceleration is None else 0
        type_mask |= IGNORE_YAW if setpoint.yaw_rad is None else 0
        head = (_time_ms(setpoint.time_us), *self._target, dialect.MAV_FRAME_LOCAL_NED, type_mask)
        motion = (*setpoint.position_ned_m, *(velocity or NOT_GIVEN), *(acceleration or NOT_GIVEN))
        return dialect.MAVLink_set_position_target_local_ned_message(*head, *motion, yaw, NAN)


def _time_ms(time_us: int) -> int:
    return time_us // 1000 & 0xFFFFFFFF


def _computer(status: ComputerStatus) -> Any:
    """The cores by themselves, the first eight; one temperature, one memory, one disk, no link."""
    cores = (*status.cpu_percent, *[_UNUSED_UINT8] * _CORES)[:_CORES]
    temperature = status.temperature_deg_c
    board = _UNUSED_INT8 if temperature is None else min(max(temperature, -0x80), _UNUSED_INT8 - 1)
    none = [_UNUSED_UINT32]
    return dialect.MAVLink_onboard_computer_status_message(
        time_usec=status.at_us,
        uptime=status.uptime_ms & 0xFFFFFFFF,
        type=0,  # the main computer
        cpu_cores=cores,
        cpu_combined=[_UNUSED_UINT8] * 10,
        gpu_cores=[_UNUSED_UINT8] * 4,
        gpu_combined=[_UNUSED_UINT8] * 10,
        temperature_board=board,
        temperature_core=[_UNUSED_INT8] * 8,
        fan_speed=[_UNUSED_INT16] * 4,
        ram_usage=status.memory_used_mib,
        ram_total=status.memory_total_mib,
        storage_type=none * 4,
        storage_usage=[status.disk_used_mib, *none * 3],
        storage_total=[status.disk_total_mib, *none * 3],
        **dict.fromkeys(("link_type", "link_tx_rate", "link_rx_rate", "link_tx_max", "link_rx_max"), none * 6),
    )


def _as_float(value: int | float) -> tuple[float, int]:
    """PARAM_SET's value and type: a whole number's bytes travel in the float's place."""
    if isinstance(value, int):
        return struct.unpack("<f", struct.pack("<i", value))[0], dialect.MAV_PARAM_TYPE_INT32
    return value, _REAL
