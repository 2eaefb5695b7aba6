"""What steers the flight on a link: setpoints, sticks, targets to follow."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from sim_vehicle.autopilot.flight_messages import (
    AttitudeTarget,
    FollowTarget,
    GlobalTarget,
    RadioChannels,
    StickInput,
)
from sim_vehicle.autopilot.messages import PositionTarget
from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.service import Handler

if TYPE_CHECKING:
    from sim_vehicle.mavlink.link import Link


class SetpointService:
    """Hands them to the autopilot, whatever the mode; PX4 answers none of them."""

    def __init__(self, link: "Link", board: Board) -> None:
        self._autopilot = board.autopilot
        self._source = board.autopilot.commander.sticks.new_link_source()

    @property
    def handlers(self) -> Mapping[type, Handler]:
        """Every kind of it."""
        receive = self._autopilot.receive
        return {
            PositionTarget: self._autopilot.setpoint,
            GlobalTarget: receive,
            AttitudeTarget: receive,
            RadioChannels: receive,
            FollowTarget: receive,
            StickInput: self._take_sticks,
        }

    def _take_sticks(self, sticks: StickInput) -> None:
        self._autopilot.receive(replace(sticks, source=self._source))
