"""SET_POSITION_TARGET_LOCAL_NED to the autopilot."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sim_vehicle.autopilot.messages import PositionTarget
from sim_vehicle.mavlink.board import Board
from sim_vehicle.mavlink.service import Handler

if TYPE_CHECKING:
    from sim_vehicle.mavlink.link import Link


class SetpointService:
    """Hands setpoints on; PX4 answers none of them."""

    def __init__(self, link: "Link", board: Board) -> None:
        self._autopilot = board.autopilot

    @property
    def handlers(self) -> Mapping[type, Handler]:
        return {PositionTarget: self._autopilot.setpoint}

    def update(self, now_us: int) -> None:
        """Nothing is sent."""
