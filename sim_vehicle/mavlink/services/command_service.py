"""COMMAND_LONG and COMMAND_INT: the receiver's answers come at once, the commander's in the next interval."""

import math
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot import commands
from sim_vehicle.autopilot.messages import EVERY_ID, Command
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.services.service import Board, Channel, Handler

_GREATEST_INT32 = 2**31 - 1


class CommandService:
    """Takes what is meant for this vehicle."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._board = board
        self.handlers: Mapping[int, Handler] = {
            11: self._set_mode,
            75: lambda packet: self._take(command_from_int(packet)),
            76: lambda packet: self._take(command_from_long(packet)),
        }

    def _set_mode(self, packet: dialect.MAVLink_set_mode_message) -> None:
        """The command that PX4 makes of it; the commander's answer is the only one, unlike with the command."""
        main, sub = packet.custom_mode >> 16 & 0xFF, packet.custom_mode >> 24
        source, target = (packet.get_srcSystem(), packet.get_srcComponent()), (packet.target_system, EVERY_ID)
        self._board.autopilot.command(Command(*source, *target, commands.DO_SET_MODE, packet.base_mode, main, sub))

    def _take(self, command: Command) -> None:
        if not commands.is_for_us(command, self._board.identity):
            return
        result, is_for_commander = commands.receive(command, self._link.streams)
        if result is not None:
            self._link.send(encode.command_ack(commands.answer(command, result)))
        if is_for_commander:
            self._board.autopilot.command(command)


def command_from_long(packet: dialect.MAVLink_command_long_message) -> Command:
    """The packet's value."""
    return _command(packet, packet.param5, packet.param6, packet.param7)


def command_from_int(packet: dialect.MAVLink_command_int_message) -> Command:
    """x and y are divided by 10^7 whatever they mean, as PX4 does; both at their greatest mean none."""
    unset = packet.x == _GREATEST_INT32 and packet.y == _GREATEST_INT32
    param5, param6 = (math.nan, math.nan) if unset else (packet.x / 1e7, packet.y / 1e7)
    return _command(packet, param5, param6, packet.z)


def _command(packet: Any, param5: float, param6: float, param7: float) -> Command:
    source = (packet.get_srcSystem(), packet.get_srcComponent())
    params = (packet.param1, packet.param2, packet.param3, packet.param4, param5, param6, param7)
    return Command(*source, packet.target_system, packet.target_component, packet.command, *params)
