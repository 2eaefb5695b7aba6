"""COMMAND_LONG and COMMAND_INT: the receiver's answers come at once, the commander's in the next interval."""

from collections.abc import Mapping

from sim_vehicle.autopilot import commands
from sim_vehicle.autopilot.messages import Command, SetMode
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.service import Channel, Handler


class CommandService:
    """Takes what is meant for this vehicle."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._board = board

    @property
    def handlers(self) -> Mapping[type, Handler]:
        return {Command: self._command, SetMode: self._set_mode}

    def _set_mode(self, request: SetMode) -> None:
        """The commander's answer is the only one, unlike with the command."""
        self._board.autopilot.command(request.command)

    def _command(self, command: Command) -> None:
        if not commands.is_for_us(command, self._board.identity):
            return
        result, is_for_commander = commands.receive(command, self._link.streams)
        if result is not None:
            self._link.send(encode.command_ack(commands.answer(command, result)))
        if is_for_commander:
            self._board.autopilot.command(command)
