"""Whose sticks count, whether they still arrive, whether the pilot moves them, and what they ask for by gesture.

Source: PX4's manual_control (ManualControlSelector.cpp, ManualControl.cpp, MovingDiff.hpp).
"""

from dataclasses import dataclass
from enum import Enum, IntEnum, auto

from sim_vehicle.autopilot.messages import RadioChannels, StickInput
from sim_vehicle.parameters.store import Parameters

RADIO_SOURCE, FIRST_LINK_SOURCE = 1, 2
_NOBODY = 0

# The filter of MovingDiff, and how long a gesture has to be held.
_DIFFERENCE_TIME_CONSTANT_S = 0.1
_GESTURE_US = 1_000_000
# How often PX4 looks for sticks that no longer arrive, counted from the last that did.
_LOOK_US = 200_000
# Of a radio's pulses, in microseconds.
_CENTRE_PULSE_US, _HALF_PULSE_US = 1500, 500
_IGNORED_PULSES = (0, 0xFFFF)


class InputMode(IntEnum):
    """COM_RC_IN_MODE."""

    RADIO = 0
    LINK = 1
    EITHER = 2
    FIRST = 3
    NONE = 4
    RADIO_THEN_LINKS = 5
    LINKS_THEN_RADIO = 6
    RADIO_THEN_LINKS_DESCENDING = 7
    LINKS_DESCENDING_THEN_RADIO = 8


class Gesture(Enum):
    """What the left stick in a corner asks for."""

    ARM = auto()
    DISARM = auto()


@dataclass(slots=True)
class _Held:
    """A gesture that has to last; it asks once."""

    since_us: int | None = None
    asked: bool = False

    def asks(self, holds: bool, now_us: int) -> bool:
        if not holds:
            self.since_us, self.asked = None, False
            return False
        if self.since_us is None:
            self.since_us = now_us
        if self.asked or now_us - self.since_us < _GESTURE_US:
            return False
        self.asked = True
        return True


class ManualInput:
    """The chosen sticks; call `update` at every step."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.sticks: StickInput | None = None
        """None while no input that counts arrives."""
        self.moving = False
        self.gesture: Gesture | None = None
        """Asked for since the last `update`."""
        self.channels: RadioChannels | None = None
        """The radio's last frame, as RC_CHANNELS shows it."""
        self._heard_us = 0
        self._first_source = _NOBODY
        self._links = 0
        self._speed = [0.0] * 4
        self._arm, self._disarm = _Held(), _Held()

    def new_link_source(self) -> int:
        """A number for one more link's sticks, in the order of the links."""
        self._links += 1
        return FIRST_LINK_SOURCE + self._links - 1

    def heard(self, sticks: StickInput, now_us: int) -> None:
        """MANUAL_CONTROL, or a radio."""
        if not self._counts(sticks.source):
            return
        if self._first_source == _NOBODY:
            self._first_source = sticks.source
        if self.sticks is not None:
            self._measure(self.sticks, sticks, 1e-6 * (now_us - self._heard_us))
        self.sticks, self._heard_us = sticks, now_us

    def heard_radio(self, channels: RadioChannels, now_us: int) -> None:
        """RC_CHANNELS_OVERRIDE: in PX4's simulation the radio itself. RC_MAP_* say which channel is which."""
        self.channels = channels
        roll, pitch, throttle, yaw = (
            self._stick(channels, name) for name in ("RC_MAP_ROLL", "RC_MAP_PITCH", "RC_MAP_THROTTLE", "RC_MAP_YAW")
        )
        if throttle is None:
            return
        self.heard(StickInput(roll or 0.0, pitch or 0.0, throttle, yaw or 0.0, RADIO_SOURCE), now_us)

    def update(self, now_us: int) -> None:
        """Judge whether the sticks still arrive, and what they ask for."""
        self.gesture = None
        sticks = self.sticks
        if sticks is None:
            return
        looked_us = now_us - (now_us - self._heard_us) % _LOOK_US
        if looked_us - self._heard_us >= 1e6 * self._parameters["COM_RC_LOSS_T"] or not self._counts(sticks.source):
            self.sticks, self.moving = None, False
            self._speed = [0.0] * 4
            self._arm, self._disarm = _Held(), _Held()
            return
        if self._parameters["MAN_ARM_GESTURE"]:
            is_low = sticks.throttle < -0.8 and abs(sticks.pitch) < 0.1 and abs(sticks.roll) < 0.1
            if self._arm.asks(is_low and sticks.yaw > 0.9, now_us):
                self.gesture = Gesture.ARM
            if self._disarm.asks(is_low and sticks.yaw < -0.9, now_us):
                self.gesture = Gesture.DISARM

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

    def _stick(self, channels: RadioChannels, name: str) -> float | None:
        number = int(self._parameters[name])
        if not 1 <= number <= len(channels.pulses_us):
            return None
        pulse_us = channels.pulses_us[number - 1]
        if pulse_us in _IGNORED_PULSES:
            return None
        return min(max((pulse_us - _CENTRE_PULSE_US) / _HALF_PULSE_US, -1.0), 1.0)

    def _counts(self, source: int) -> bool:
        """Whether COM_RC_IN_MODE lets this source in, beside the one that is in."""
        mode = self._parameters["COM_RC_IN_MODE"]
        chosen = self.sticks.source if self.sticks is not None else None
        is_radio, was_radio = source == RADIO_SOURCE, chosen == RADIO_SOURCE
        if mode == InputMode.RADIO:
            return is_radio
        if mode == InputMode.LINK:
            return not is_radio and chosen in (None, source)
        if mode == InputMode.EITHER:
            return chosen in (None, source)
        if mode == InputMode.FIRST:
            return self._first_source in (_NOBODY, source)
        if chosen is None:
            return mode != InputMode.NONE
        if mode == InputMode.RADIO_THEN_LINKS:
            return source <= chosen
        if mode == InputMode.LINKS_THEN_RADIO:
            return was_radio or (not is_radio and source <= chosen)
        if mode == InputMode.RADIO_THEN_LINKS_DESCENDING:
            return is_radio or (not was_radio and source >= chosen)
        return mode == InputMode.LINKS_DESCENDING_THEN_RADIO and source >= chosen
