"""What one hit on a wall left behind."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.errors import ReboundError

Floats = npt.NDArray[np.float64]


class IdentificationError(ReboundError):
    """Data from which no contact can be identified: the sentence says what is missing."""


@dataclass(frozen=True, slots=True)
class Push:
    """The wall's push through a hit, as an inertial sensor shows it."""

    since_touch_s: Floats
    depth_m: Floats  # of the centre of mass beyond its place at the first touch
    speed_m_s: Floats  # towards the wall
    acceleration_m_s2: Floats  # away from the wall, without thrust and gravity


@dataclass(frozen=True, slots=True)
class Hit:
    """One hit. Speeds are of the centre of mass, across the wall's face."""

    name: str
    at_s: float  # of the data's own clock
    speed_in_m_s: float  # the greatest towards the wall before it
    speed_out_m_s: float  # the greatest away from the wall after it
    speed_sigma_m_s: float  # standard deviation of either speed
    guards: int  # that meet the wall: 2 head-on, 1 with the nose turned by 45 degrees
    push: Push | None = None
    stop_m: float | None = None  # depth at which the stop of the arms was met, if it was

    @property
    def ratio(self) -> float:
        return self.speed_out_m_s / self.speed_in_m_s

    @property
    def normal_change_m_s(self) -> float:
        return self.speed_in_m_s + self.speed_out_m_s


def guards_at(angle_rad: float) -> int:
    """2 where the nose, or a side, is within 22.5 degrees of the wall's normal; 1 at the diagonals."""
    off_rad = (angle_rad + math.pi / 4) % (math.pi / 2) - math.pi / 4
    return 2 if abs(off_rad) < math.pi / 8 else 1
