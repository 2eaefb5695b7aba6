"""Flies a vehicle in lockstep over its bytes, as a companion would."""

from typing import Any

from sim_vehicle.testing import LockstepVehicle
from tests.sim_vehicle.vehicle_client import ARM_DISARM, TAKEOFF, End


class Pilot(End):
    """Commands out, messages in; each message with the vehicle's time at which it came."""

    def __init__(self, vehicle: LockstepVehicle) -> None:
        super().__init__(vehicle.send)
        self.vehicle = vehicle

    def fly(self, seconds: float) -> None:
        """Let time pass and listen, an interval at a time."""
        until_s = self.vehicle.time_s + seconds
        while self.vehicle.time_s < until_s - 1e-9:
            self.hear([self.vehicle.advance(0.0)], self.vehicle.time_s)

    def take_off(self) -> None:
        """To 2.5 m, where it holds."""
        self.command(ARM_DISARM, 1, 0)
        self.command(TAKEOFF)
        self.vehicle.advance_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2, 20)
        self.fly(1.0)
        self.forget()


def hovering(**setup: Any) -> Pilot:
    """Taken off in a vehicle of its own."""
    pilot = Pilot(LockstepVehicle(**setup))
    pilot.take_off()
    return pilot
