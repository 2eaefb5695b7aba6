"""COMMAND_LONG and COMMAND_INT, in PX4's two layers.

The receiver answers at once what concerns the link and, for DO_SET_MODE, answers ACCEPTED before anyone has looked at
it. The commander does the rest in the next interval, and answers once more with the true result. Source:
MavlinkReceiver::handle_message_command_both of PX4.
"""

import math
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot import commands
from sim_vehicle.autopilot.messages import EVERY_ID, Command, Result
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.services.service import Board, Channel, Service

GET_MESSAGE_INTERVAL = 510
SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512
REQUEST_AUTOPILOT_CAPABILITIES = 520
"""Answered whichever component it is for."""
# The commands from before REQUEST_MESSAGE, each for one message: AUTOPILOT_VERSION, HOME_POSITION, FLIGHT_INFORMATION,
# STORAGE_INFORMATION.
REQUESTS = {REQUEST_AUTOPILOT_CAPABILITIES: 148, 410: 242, 528: 264, 525: 261}
_MESSAGE_INTERVAL_ID = 244

_GREATEST_INT32 = 2**31 - 1


class CommandService(Service):
    """Takes what is meant for this vehicle."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._board = board
        self.handlers = {
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
        if not self._is_for_us(command):
            return
        result = self._received(command)
        if result is not None:
            self._link.send(encode.command_ack(commands.answer(command, result)))
        if result is None or command.command == commands.DO_SET_MODE:
            self._board.autopilot.command(command)

    def _is_for_us(self, command: Command) -> bool:
        """Whether PX4 takes the command: others are not answered, nor are its own echoes."""
        us = self._board.identity
        if (command.source_system, command.source_component) == us:
            return False
        if command.command == REQUEST_AUTOPILOT_CAPABILITIES:
            return command.target_system in (us.system, EVERY_ID)
        return us.is_addressed(command.target_system, command.target_component)

    def _received(self, command: Command) -> Result | None:
        """The receiver's answer, if it has one."""
        if command.command == commands.DO_SET_MODE:
            return Result.ACCEPTED
        if command.command == SET_MESSAGE_INTERVAL:
            return Result.ACCEPTED if self._set_interval(command) else Result.FAILED
        if command.command == GET_MESSAGE_INTERVAL:
            return self._tell_interval(command.param1)
        asked = commands.whole(command.param1) if command.command == REQUEST_MESSAGE else REQUESTS.get(command.command)
        if asked is None:
            return None
        if asked == _MESSAGE_INTERVAL_ID:
            return self._tell_interval(command.param2)
        return Result.ACCEPTED if self._link.streams.send_now(asked) else Result.DENIED

    def _set_interval(self, command: Command) -> bool:
        # Response target and the two reserved parameters: PX4 supports none of them.
        if any(commands.whole(value, unset=0) != 0 for value in (command.param3, command.param4, command.param7)):
            return False
        return self._link.streams.set_interval(commands.whole(command.param1), command.param2)

    def _tell_interval(self, message: float) -> Result:
        number = commands.whole(message)
        told = dialect.MAVLink_message_interval_message(number & 0xFFFF, self._link.streams.interval_us(number))
        self._link.send(told)
        return Result.ACCEPTED


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
