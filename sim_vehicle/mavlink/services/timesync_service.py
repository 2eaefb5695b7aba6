"""TIMESYNC requests answered with the vehicle's clock."""

from collections.abc import Mapping

from sim_vehicle.autopilot.messages import TimeSyncRequest
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.service import Channel, Handler


class TimeSyncService:
    """Answers at once."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        # Bytes arrive anywhere in the interval since the last sample: on average in its middle.
        self._half_interval_us = board.interval_us // 2

    @property
    def handlers(self) -> Mapping[type, Handler]:
        return {TimeSyncRequest: self._answer}

    def _answer(self, request: TimeSyncRequest) -> None:
        self._link.send(encode.timesync_reply(request, self._link.now_us + self._half_interval_us))
