"""Did the accelerometer show the whole of a contact? By the means over its windows, which is all that is heard.

Raw samples are clipped at the range before they are averaged, so that a mean far below the range may hide a pulse that
went far beyond it: a stiff frame's contact of 1 ms shows no more than a fifth of the range in a window of 5 ms, however
hard it was. What lasts, on the other hand, shows in the windows beside: what they do not explain may have been over in
no time. A vehicle that clatters along an obstacle shows pushes that turn round from one window to the next.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3

NONE: Vector3 = (0.0, 0.0, 0.0)
# The mean over a window of a pulse that reaches the range's end: one of a third of the window's length shows a third
# of the range.
CLIPPED_SHARE = 1.0 / 3.0
# The shortest contact that changes a velocity by much: a stiff frame's lasts for 1.0 to 1.5 ms.
SHORTEST_US = 1_000
# The mean of half a sine over its length. A contact that short, and all of it within one window, has reached the range
# where the window's mean is this times its share of the window: 20 m/s^2 of 16 g in 5 ms.
HALF_SINE = 2.0 / math.pi
# Of half a sine over three windows and more, no window's mean is above the sum of its neighbours'; over four and more,
# those of two windows together are not above this times the sum of theirs.
BESIDE_TWO = 2.5


def may_have_clipped(specific_force_frd_m_s2: Vector3, range_m_s2: float) -> bool:
    """Whether a window's mean alone is so large that the range may not have been enough."""
    x, y, z = specific_force_frd_m_s2
    return max(abs(x), abs(y), abs(z)) >= CLIPPED_SHARE * range_m_s2


@dataclass(slots=True)
class Clipping:
    """Of one contact, from its first sample to its end; changed only by `add`."""

    averaging_us: int
    range_m_s2: float
    recent_frd_m_s2: tuple[Vector3, Vector3, Vector3, Vector3] = (NONE, NONE, NONE, NONE)
    """The contact's force per unit mass in the last four samples, the newest last."""
    hides: bool = False
    """Part of the force may have been beyond the range."""

    def add(self, specific_force_frd_m_s2: Vector3, contact_frd_m_s2: Vector3, contiguous: bool) -> None:
        """Take one sample, loud or not. Where its window touches the last, a pulse may have been cut in two."""
        self.recent_frd_m_s2 = (*self.recent_frd_m_s2[1:], contact_frd_m_s2)
        self.hides = self.hides or may_have_clipped(specific_force_frd_m_s2, self.range_m_s2)
        for before, one, two, after in zip(*self.recent_frd_m_s2, strict=True):
            alone = _beyond(two, one, after)
            cut = _beyond(one + two, BESIDE_TWO * before, BESIDE_TWO * after) if contiguous else 0.0
            self.hides = self.hides or max(alone, cut) >= self._short_m_s2

    @property
    def may_hide(self) -> bool:
        """The same, with what the newest sample would be if nothing came after it."""
        _, _, before, newest = self.recent_frd_m_s2
        return self.hides or any(_beyond(n, b, 0.0) >= self._short_m_s2 for b, n in zip(before, newest, strict=True))

    @property
    def _short_m_s2(self) -> float:
        """A window's mean from which on the shortest contact has reached the range."""
        return HALF_SINE * SHORTEST_US / self.averaging_us * self.range_m_s2


def _beyond(middle: float, before: float, after: float) -> float:
    """By how much more there is of a force than on either side of it; a push the other way explains nothing."""
    if middle < 0.0:
        middle, before, after = -middle, -before, -after
    return middle - max(before, 0.0) - max(after, 0.0)
