"""Whose sticks count, whether they still arrive, and whether the pilot moves them.

Source: PX4's manual_control (ManualControlSelector.cpp, ManualControl.cpp, MovingDiff.hpp), for sticks that come over
links: this vehicle has no radio.
"""

from sim_vehicle.autopilot.messages import StickInput
from sim_vehicle.parameters.store import Parameters

# The filter of MovingDiff.
_DIFFERENCE_TIME_CONSTANT_S = 0.1
# How often PX4 looks for sticks that no longer arrive, counted from the last that did.
_LOOK_US = 200_000
# COM_RC_IN_MODE: a radio alone, or nobody.
_NO_LINKS = (0, 4)


class ManualInput:
    """The chosen sticks: those of the first link, until they no longer arrive. Call `update` at every step."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.sticks: StickInput | None = None
        """None while no input that counts arrives."""
        self.moving = False
        self._heard_us = 0
        self._links = 0
        self._speed = [0.0] * 4

    def new_link_source(self) -> int:
        """A number for one more link's sticks."""
        self._links += 1
        return self._links

    def heard(self, sticks: StickInput, now_us: int) -> None:
        """MANUAL_CONTROL."""
        before = self.sticks
        if not self._links_count or (before is not None and before.source != sticks.source):
            return
        if before is not None:
            self._measure(before, sticks, 1e-6 * (now_us - self._heard_us))
        self.sticks, self._heard_us = sticks, now_us

    def update(self, now_us: int) -> None:
        """Judge whether the sticks still arrive."""
        looked_us = now_us - (now_us - self._heard_us) % _LOOK_US
        if looked_us - self._heard_us >= 1e6 * self._parameters["COM_RC_LOSS_T"] or not self._links_count:
            self.sticks, self.moving = None, False
            self._speed = [0.0] * 4

    def _measure(self, before: StickInput, now: StickInput, step_s: float) -> None:
        """COM_RC_STICK_OV: how fast, in percent of the way a second, a stick moves when the pilot means it."""
        if step_s <= 0.0:
            return
        share = step_s / (step_s + _DIFFERENCE_TIME_CONSTANT_S)
        moves = (
            now.roll - before.roll,
            now.pitch - before.pitch,
            now.yaw - before.yaw,
            now.throttle - before.throttle,
        )
        self._speed = [speed + share * (move / step_s - speed) for speed, move in zip(self._speed, moves, strict=True)]
        self.moving = max(map(abs, self._speed)) > 0.01 * self._parameters["COM_RC_STICK_OV"]

    @property
    def _links_count(self) -> bool:
        return self._parameters["COM_RC_IN_MODE"] not in _NO_LINKS
