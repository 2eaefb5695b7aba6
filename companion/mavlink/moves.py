"""What would move a vehicle that the guard recovers.

Everything else passes, a person's words above all: sticks, every mode but OFFBOARD, disarming, flight termination.
"""

import math
from itertools import accumulate
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.autopilot.interface import Autopilot, Pilot
from companion.mavlink.encode import IGNORE_POSITION, IGNORE_VELOCITY
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.messages import Asked, Vector3

# COMMAND_INT: a place of whole numbers that is not given.
_NO_PLACE_INT = 0x7FFF_FFFF
# Companion computers, planners and cameras that fly (MAV_COMP_ID_ONBOARD_COMPUTER to VISUAL_INERTIAL_ODOMETRY). A hand
# has its sticks on a ground station, which has any other number.
_ON_BOARD = range(dialect.MAV_COMP_ID_ONBOARD_COMPUTER, dialect.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY + 1)
# PX4 flies by the latest setpoint, whoever sent it.
SETPOINT_IDS = frozenset(
    {
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        dialect.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET,
    }
)
_COMMANDS = (dialect.MAVLINK_MSG_ID_COMMAND_LONG, dialect.MAVLINK_MSG_ID_COMMAND_INT)
# What may ask for a mode.
REQUEST_IDS = frozenset({*_COMMANDS, dialect.MAVLINK_MSG_ID_SET_MODE})
# The same by name, for MAVSDK.
SETPOINTS, REQUESTS = (
    frozenset(dialect.mavlink_map[number].msgname for number in ids) for ids in (SETPOINT_IDS, REQUEST_IDS)
)
STICKS_IDS = (dialect.MAVLINK_MSG_ID_MANUAL_CONTROL, dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE)
_ITEMS = (dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT)


def fields_of(packet: bytes) -> dict[str, Any]:
    """Of a whole packet of this dialect: its fields by name; of an array the first value."""
    message, payload = dialect.mavlink_map[message_id_of(packet)], payload_of(packet)
    values = message.unpacker.unpack(payload.ljust(message.unpacker.size, b"\0")[: message.unpacker.size])
    places = accumulate(message.lengths, initial=0)
    return {name: values[place] for name, place in zip(message.ordered_fieldnames, places, strict=False)}


def would_move(packet: bytes, autopilot: Autopilot) -> bool:
    """Whether a whole packet, on its way to a vehicle that is being recovered, is to be kept out.

    OFFBOARD is the guard's meanwhile, and a place that was named before the hit may be behind it.
    """
    message_id = message_id_of(packet)
    if message_id in SETPOINT_IDS:
        return True
    if message_id in STICKS_IDS:
        # A program's look like a pilot's, for whom the guard stands down.
        return source_of(packet)[1] in _ON_BOARD
    if message_id == dialect.MAVLINK_MSG_ID_SET_MODE:
        return autopilot.mode(fields_of(packet)["custom_mode"]).pilot is Pilot.SETPOINTS
    if message_id in _ITEMS:
        # ArduPilot's older way to be sent somewhere, as DroneKit's simple_goto has it: 2 is a place, 3 a height.
        return fields_of(packet)["current"] in (2, 3)
    return message_id in _COMMANDS and _command_moves(fields_of(packet), autopilot)


def _command_moves(fields: dict[str, Any], autopilot: Autopilot) -> bool:
    """A reposition to no place is how QGroundControl stops the vehicle."""
    match fields["command"]:
        case dialect.MAV_CMD_DO_SET_MODE:
            return bool(fields["param2"] == autopilot.mode_parameters(autopilot.setpoints)[0])
        case dialect.MAV_CMD_NAV_GUIDED_ENABLE:
            return bool(fields["param1"] > 0.0)
        case dialect.MAV_CMD_DO_REPOSITION | dialect.MAV_CMD_DO_CHANGE_ALTITUDE:
            return _has_place(fields)
    return fields["command"] in (dialect.MAV_CMD_DO_ORBIT, dialect.MAV_CMD_DO_FIGURE_EIGHT)


def _has_place(fields: dict[str, Any]) -> bool:
    """Of COMMAND_INT by its whole numbers, of COMMAND_LONG by its last parameters."""
    if "x" in fields:
        return {fields["x"], fields["y"]} != {_NO_PLACE_INT} or math.isfinite(fields["z"])
    return any(math.isfinite(fields[name]) for name in ("param5", "param6", "param7"))


def is_for(packet: bytes, system_id: int | None) -> bool:
    """Whether a whole packet is for that system; so is one that names none, and while none is known every one."""
    fields = fields_of(packet) if message_id_of(packet) in dialect.mavlink_map else {}
    return system_id is None or fields.get("target_system", fields.get("target", 0)) in (0, system_id)


def asked_by(packet: bytes) -> Asked | None:
    """Where a setpoint leads; None of what is no setpoint."""
    message_id, fields = message_id_of(packet), {}
    if message_id == dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
        fields = fields_of(packet)
    if fields.get("coordinate_frame") != dialect.MAV_FRAME_LOCAL_NED:
        return Asked() if message_id in SETPOINT_IDS else None
    place, velocity = (fields["x"], fields["y"], fields["z"]), (fields["vx"], fields["vy"], fields["vz"])
    mask = fields["type_mask"]
    return Asked(_unless(mask & IGNORE_POSITION, place), _unless(mask & IGNORE_VELOCITY, velocity))


def _unless(ignored: int, vector: Vector3) -> Vector3 | None:
    return None if ignored or not all(map(math.isfinite, vector)) else vector


def interval_asked(packet: bytes) -> tuple[int | None, int] | None:
    """The message that a packet asks the vehicle to stream, None for a group of them, and its interval; None where it
    asks for none.
    """
    if message_id_of(packet) == dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM:
        return None, 0
    fields = fields_of(packet) if message_id_of(packet) in _COMMANDS else {}
    if fields.get("command") != dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
        return None
    stream, interval_us = fields["param1"], fields["param2"]
    is_given = math.isfinite(stream) and math.isfinite(interval_us)
    return (int(stream), int(interval_us)) if is_given else None
