"""Flies a vehicle in lockstep over its bytes, as a companion would."""

import math
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.testing import LockstepVehicle

ARM, TAKEOFF = 400, 22


class Pilot:
    """Commands out, messages in; each message with the vehicle's time at which it came."""

    def __init__(self, vehicle: LockstepVehicle) -> None:
        self.vehicle = vehicle
        self.heard: list[tuple[float, Any]] = []
        self._link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True

    def send(self, message: Any) -> None:
        self.vehicle.send(message.pack(self._link))
        self._link.seq = (self._link.seq + 1) % 256

    def command(self, number: int, *params: float) -> None:
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *params, *[math.nan] * (7 - len(params))))

    def fly(self, seconds: float) -> None:
        """Let time pass and listen, an interval at a time."""
        until_s = self.vehicle.time_s + seconds
        while self.vehicle.time_s < until_s - 1e-9:
            self.hear(self.vehicle.advance(0.0))

    def hear(self, data: bytes) -> None:
        self.heard += [(self.vehicle.time_s, message) for message in self._parser.parse_buffer(data) or []]

    def take_off(self) -> None:
        """To 2.5 m, where it holds."""
        self.command(ARM, 1, 0)
        self.command(TAKEOFF)
        self.hear(self.vehicle.advance_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2, 20))
        self.fly(1.0)
        self.heard.clear()

    def of(self, kind: str) -> list[Any]:
        return [message for _, message in self.heard if message.get_type() == kind]

    def times(self, kind: str) -> list[float]:
        return [time_s for time_s, message in self.heard if message.get_type() == kind]
