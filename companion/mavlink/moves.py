"""What would move a vehicle that the guard recovers: one table, each entry with its reason.

Everything else passes, a person's words above all: sticks, every mode but OFFBOARD, disarming, flight termination.
"""

import math
import struct
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import development as dialect

from companion.autopilot.interface import Autopilot, Pilot
from companion.mavlink.packet import opened
from companion.messages import Asked, SetMessageInterval, Vector3

Source: TypeAlias = tuple[int, int]
Test: TypeAlias = Callable[[bytes, Source, Autopilot], bool]

# Both commands' packets begin with four parameters and have a place of three values and the command's number then. In
# one the place has floats, in the other two whole numbers first.
_LONG, _INT = struct.Struct("<7fH"), struct.Struct("<4f2ifH")
_NO_PLACE_INT = 0x7FFF_FFFF
_COMMAND_SIZE = 33
# SET_MODE: the custom mode.
_MODE = struct.Struct("<I")
# POSITION_TARGET_TYPEMASK: any of the three that is to be ignored.
_NO_PLACE, _NO_VELOCITY = 0x007, 0x038
# Companion computers, planners and cameras that fly (MAV_COMP_ID_ONBOARD_COMPUTER to VISUAL_INERTIAL_ODOMETRY). A hand
# has its sticks on a ground station, which has any other number.
_ON_BOARD = range(dialect.MAV_COMP_ID_ONBOARD_COMPUTER, dialect.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY + 1)


def _always(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    return True


def _on_board(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    return source[1] in _ON_BOARD


def _mode_flies_setpoints(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    (custom_mode,) = _MODE.unpack_from(payload.ljust(_MODE.size, b"\0"))
    return autopilot.pilot(custom_mode) is Pilot.SETPOINTS


def _long_moves(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    *parameters, command = _LONG.unpack_from(payload.ljust(_COMMAND_SIZE, b"\0"))
    return _moves(autopilot, command, parameters[:4], any(map(math.isfinite, parameters[4:])))


def _int_moves(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    *parameters, x, y, z, command = _INT.unpack_from(payload.ljust(_COMMAND_SIZE, b"\0"))
    return _moves(autopilot, command, parameters, {x, y} != {_NO_PLACE_INT} or math.isfinite(z))


def _moves(autopilot: Autopilot, command: int, parameters: list[float], has_place: bool) -> bool:
    """A reposition to no place is how QGroundControl stops the vehicle."""
    match command:
        case dialect.MAV_CMD_DO_SET_MODE:
            return parameters[1] == autopilot.set_mode(autopilot.setpoints).parameters[0]
        case dialect.MAV_CMD_NAV_GUIDED_ENABLE:
            return parameters[0] > 0.0
        case dialect.MAV_CMD_DO_REPOSITION | dialect.MAV_CMD_DO_CHANGE_ALTITUDE:
            return has_place
    return command in (dialect.MAV_CMD_DO_ORBIT, dialect.MAV_CMD_DO_FIGURE_EIGHT)


# MISSION_ITEM and MISSION_ITEM_INT: where `current` lies, and its values for a place to fly to now and a height.
_CURRENT, _FLOWN_AT_ONCE = 35, (2, 3)


def _is_flown_at_once(payload: bytes, source: Source, autopilot: Autopilot) -> bool:
    """ArduPilot's older way to be sent somewhere, as DroneKit's simple_goto has it."""
    return payload.ljust(_CURRENT + 1, b"\0")[_CURRENT] in _FLOWN_AT_ONCE


_SETPOINT = "PX4 flies by the latest setpoint, whoever sent it"
_STICKS = "a program's sticks look like a pilot's, for whom the guard stands down"
_COMMAND = "OFFBOARD is the guard's meanwhile, and a place that was named before the hit may be behind it"
KEPT_OUT: Mapping[int, tuple[Test, str]] = {
    dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: (_always, _SETPOINT),
    dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: (_always, _SETPOINT),
    dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: (_always, _SETPOINT),
    dialect.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET: (_always, _SETPOINT),
    dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: (_on_board, _STICKS),
    dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: (_on_board, _STICKS),
    dialect.MAVLINK_MSG_ID_MISSION_ITEM: (_is_flown_at_once, _COMMAND),
    dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT: (_is_flown_at_once, _COMMAND),
    dialect.MAVLINK_MSG_ID_SET_MODE: (_mode_flies_setpoints, _COMMAND),
    dialect.MAVLINK_MSG_ID_COMMAND_LONG: (_long_moves, _COMMAND),
    dialect.MAVLINK_MSG_ID_COMMAND_INT: (_int_moves, _COMMAND),
}
SETPOINT_IDS = frozenset(number for number, (_, reason) in KEPT_OUT.items() if reason is _SETPOINT)
# The same by name, for MAVSDK.
SETPOINTS = frozenset(dialect.mavlink_map[number].msgname for number in SETPOINT_IDS)


def asked_by(packet: bytes) -> Asked | None:
    """Where a setpoint leads; None of what is no setpoint."""
    message_id, _, payload = opened(packet)
    if message_id not in SETPOINT_IDS:
        return None
    message = dialect.mavlink_map[message_id]
    values = message.unpacker.unpack(payload.ljust(message.unpacker.size, b"\0")[: message.unpacker.size])
    return asked_of(message.msgname, dict(zip(message.ordered_fieldnames, values, strict=False)))


def asked_of(name: str, fields: Mapping[str, Any]) -> Asked:
    """The same of names and fields."""
    if name != "SET_POSITION_TARGET_LOCAL_NED" or fields.get("coordinate_frame") != dialect.MAV_FRAME_LOCAL_NED:
        return Asked()
    mask = fields.get("type_mask", _NO_PLACE | _NO_VELOCITY)
    place, velocity = (_vector([fields.get(name) for name in names]) for names in (("x", "y", "z"), ("vx", "vy", "vz")))
    return Asked(None if mask & _NO_PLACE else place, None if mask & _NO_VELOCITY else velocity)


def _vector(values: list[float | None]) -> Vector3 | None:
    north, east, down = values
    if north is None or east is None or down is None or not all(map(math.isfinite, (north, east, down))):
        return None
    return (north, east, down)


def would_move(packet: bytes, autopilot: Autopilot) -> bool:
    """Whether a whole packet, on its way to a vehicle that is being recovered, is to be kept out."""
    message_id, source, payload = opened(packet)
    test, _ = KEPT_OUT.get(message_id, (None, ""))
    return test is not None and test(payload, source, autopilot)


def interval_asked(packet: bytes) -> SetMessageInterval | None:
    """The stream that a packet asks the vehicle for; None where it asks for none."""
    message_id, _, payload = opened(packet)
    if message_id not in (dialect.MAVLINK_MSG_ID_COMMAND_LONG, dialect.MAVLINK_MSG_ID_COMMAND_INT):
        return None
    stream, interval_us, *_, command = _LONG.unpack_from(payload.ljust(_COMMAND_SIZE, b"\0"))
    is_given = math.isfinite(stream) and math.isfinite(interval_us)
    asks = command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and is_given
    return SetMessageInterval(int(stream), int(interval_us)) if asks else None
