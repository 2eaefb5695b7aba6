"""What one hit on a wall left behind, whichever instrument saw it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.errors import ReboundError

Floats = npt.NDArray[np.float64]


class IdentificationError(ReboundError):
    """Data from which no contact can be identified: the sentence says what is missing."""


@dataclass(frozen=True, slots=True)
class Track:
    """Positions through a hit along the wall's normal."""

    time_s: Floats
    towards_wall_m: Floats
    """Grows towards the wall, from any origin."""
    interval_s: float


@dataclass(frozen=True, slots=True)
class Push:
    """The wall's push through a hit, as an inertial sensor shows it."""

    since_touch_s: Floats
    depth_m: Floats
    """How far the centre of mass has come since the first touch."""
    speed_m_s: Floats
    """Towards the wall."""
    acceleration_m_s2: Floats
    """Away from the wall, thrust and gravity not in it."""


@dataclass(frozen=True, slots=True)
class Force:
    """What a force sensor in the wall showed, along the direction of its greatest push."""

    peak_n: float
    pull_n: float
    """The greatest force the other way. A wall cannot pull: this is the sensor's mounting, ringing."""
    impulse_n_s: float
    """Over the whole ringing: mass times the change of speed, if the sensor misses nothing."""


@dataclass(frozen=True, slots=True)
class Hit:
    """One hit. Speeds are of the centre of mass; `along` is the horizontal component in the wall's face."""

    name: str
    at_s: float
    """Of the data's own clock."""
    speed_in_m_s: float
    """Greatest speed towards the wall before it."""
    speed_out_m_s: float
    """Greatest speed away from the wall after it."""
    speed_sigma_m_s: float
    """Standard deviation of either speed, from the noise of the data."""
    along_in_m_s: float
    along_out_m_s: float
    guards: int
    """Guards that meet the wall: 2 head-on, 1 with the nose turned by 45 degrees."""
    track: Track | None = None
    push: Push | None = None
    force: Force | None = None
    stop_m: float | None = None
    """Depth at which the stop of the arms was met, if it was."""

    @property
    def ratio(self) -> float:
        return self.speed_out_m_s / self.speed_in_m_s

    @property
    def normal_change_m_s(self) -> float:
        return self.speed_in_m_s + self.speed_out_m_s
