"""Detect a motor or propeller damaged by a hit: its output is higher than before, relative to the others.

PX4's rate control commands the lift that a damaged propeller or motor of a quadrotor lacks from that motor alone: in
steady flight lift and drag torque of all four stay the same. A shifted load, or a force on the vehicle, loads two
motors more, or one as much as it relieves the opposite one. Of six or eight, PX4's pseudo-inverse relieves the opposite
motors for either, but a shifted load also loads the neighbours more.

No model of the vehicle is needed. Each half second of the flight before the hit shows how the outputs differ, with
trim, wind and manoeuvres. A motor is damaged if after the recovery its relative output exceeds all of these. For
windows in random order the probability that the m last exceed all n first is 1 / C(n + m, m); n motors have n
chances.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import fmean, median
from typing import TypeAlias

# Five SERVO_OUTPUT_RAW at the 10 Hz of PX4's onboard set. A turn begins and ends within this time.
WINDOW_US = 500_000
# Half a minute of windows after the hit is enough, and ten minutes of before it.
MOST_WINDOWS, MOST_BEFORE = 60, 1200
# The usual level of significance.
LEAST_CONFIDENCE = 0.99
# Least relative increase that is reported. A rotor that has lost a twentieth of its blades lifts 0.95^3 of its lift
# (lift grows with r^2 dr), and needs a command of 1.08 where lift grows with its square. Half of that increase counts.
LEAST_HARDER = 0.04
# Largest difference among the other three motors, in increases of the first. A weight that shifts towards one motor
# relieves the opposite one: the other three then differ by 0.5. For one damaged motor they do not differ. Half way.
MOST_UNLIKE = 0.25
# How many of SERVO_OUTPUT_RAW are motors, by the vehicle's type.
ROTORS = {"quadrotor": 4, "hexarotor": 6, "octorotor": 8}
# Largest increase of any other of six or eight motors, in increases of the first. By the pseudo-inverse of an even ring
# it is 0 of six and 0.33 of eight for one damaged motor, 0.5 and 0.71 for a weight that shifts towards one. Half way.
MOST_SHARED = {6: 0.25, 8: 0.52}
# The least that PX4 lets a PWM output be (PWM_MAIN_MINn). Outputs of DShot and CAN begin at zero, those of PWM at 1 ms.
LEAST_PWM, PWM_ZERO = 800.0, 1000.0

Outputs: TypeAlias = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Damage:
    """`motor` counts from 1, as PX4's outputs. `harder`: beside the others, in shares of their mean."""

    motor: int
    harder: float
    confidence: float
    is_at_limit: bool

    @property
    def text(self) -> str:
        limit = ", all it has" if self.is_at_limit else ""
        return f"motor {self.motor} works {self.harder:.0%} harder than before{limit} ({self.confidence:.1%} sure)"


@dataclass(slots=True)
class MotorWatch:
    """Of one flight of a vehicle whose motors are outputs 1 to 4, 6 or 8."""

    earlier_hits: int = 0  # of flights before this one
    damage: Damage | None = None
    # Of each window: see `_shares`.
    _before: deque[list[float]] = field(default_factory=lambda: deque(maxlen=MOST_BEFORE))
    _after: list[list[float]] = field(default_factory=list)
    _samples_after: list[Outputs] = field(default_factory=list)
    _window: list[Outputs] = field(default_factory=list)
    _window_began_us: int = 0
    _least: float = math.inf
    _most: float = -math.inf
    _was_hit: bool | None = None

    def take(self, outputs: Outputs, was_hit: bool | None, now_us: int) -> Damage | None:
        """Of a vehicle that is armed. `was_hit`: None where its flight says nothing, as in a recovery."""
        self._least, self._most = min(self._least, *outputs), max(self._most, *outputs)
        if was_hit is not self._was_hit:
            self._was_hit, self._window = was_hit, []
            self._after, self._samples_after = [], []
        if was_hit is None or self.damage is not None or len(self._after) >= MOST_WINDOWS:
            return None
        if not self._window:
            self._window_began_us = now_us
        self._window.append(outputs)
        if was_hit:
            self._samples_after.append(outputs)
        if now_us - self._window_began_us < WINDOW_US:
            return None
        zero = PWM_ZERO if self._least >= LEAST_PWM else 0.0
        (self._after if was_hit else self._before).append(_shares(self._window, zero))
        self._window = []
        self.damage = self._judged() if was_hit else None
        return self.damage

    def _judged(self) -> Damage | None:
        count = len(self._after)
        motors = len(self._after[0])
        confidence = 1.0 - motors / math.comb(len(self._before) + count, count)
        if confidence < LEAST_CONFIDENCE:
            return None
        before, after = (list(zip(*windows, strict=True)) for windows in (self._before, self._after))
        changes = [median(now) - median(was) for now, was in zip(after, before, strict=True)]
        motor = max(range(motors), key=changes.__getitem__)
        others = [change for number, change in enumerate(changes) if number != motor]
        harder = changes[motor] - fmean(others)
        if harder < LEAST_HARDER or min(after[motor]) <= max(before[motor]):
            return None
        # One that gives all that it has says the same most of the time, and how much more is wanted is not seen.
        shown = [outputs[motor] for outputs in self._samples_after]
        is_at_limit = median(shown) == self._most
        unlike = max(abs(change - fmean(others)) for change in others)
        if motors in MOST_SHARED:
            is_alone = max(others) < MOST_SHARED[motors] * changes[motor]
        else:
            is_alone = unlike < MOST_UNLIKE * harder
        return Damage(motor + 1, harder, confidence, is_at_limit) if is_alone or is_at_limit else None


def _shares(window: Sequence[Outputs], zero: float) -> list[float]:
    """Each motor's mean output beyond `zero`, as a share of the mean of all.

    One microsecond is what PWM can tell apart: of less nothing is a share.
    """
    means = [fmean(column) - zero for column in zip(*window, strict=True)]
    return [each / max(fmean(means), 1.0) for each in means]
