"""Whether the vehicle is meant to go down: by its mode, by what its position control is asked for, or by hand."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.autopilot.interface import Pilot
from companion.link.vehicle import OLD_NEWS_US, Vehicle
from companion.messages import LandedState, PositionTarget, Sample, Sticks
from companion.motion.config import SAME_M_S

THROTTLE = 2


@dataclass(slots=True)
class Descent:
    """Changed only by `update`. Receive times are on the companion's clock."""

    velocity_down_m_s: float = 0.0
    setpoint_us: int | None = None
    throttle: float | None = None

    def update(self, samples: Sequence[Sample], now_us: int) -> None:
        for sample in samples:
            if isinstance(sample, PositionTarget):
                self.velocity_down_m_s, self.setpoint_us = sample.velocity_down_m_s or 0.0, now_us
            elif isinstance(sample, Sticks):
                self.throttle = sample.deflections[THROTTLE]

    def is_meant(self, vehicle: Vehicle, now_us: int) -> bool:
        """A pilot who flies by attitude or rates has the thrust in hand: what lets the vehicle down is meant.

        So it is where the sticks ask for velocities, and nothing has ever told which.
        """
        if vehicle.landed is LandedState.LANDING or vehicle.descends or vehicle.pilot is Pilot.HAND:
            return True
        deadzone = vehicle.autopilot.stick_deadzone
        sinks = self.setpoint_us is None if self.throttle is None else self.throttle < -deadzone
        if vehicle.pilot is Pilot.STICKS and sinks:
            return True
        is_current = self.setpoint_us is not None and now_us - self.setpoint_us < OLD_NEWS_US
        return is_current and self.velocity_down_m_s > SAME_M_S
