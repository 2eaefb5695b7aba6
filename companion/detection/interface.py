"""The interface of all collision detectors: samples in, impact out, state explicit."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeVar

from companion.messages import ImuSample, Vector3


class Phase(Enum):
    """What a detector is doing; the value is the word shown to people."""

    OFF = "off"  # not wanted now: `off_reason` says why
    QUIET = "quiet"  # switched on, waiting for a quiet interval before it trusts itself
    ARMED = "armed"  # the next sign of a hit fires
    CONTACT = "contact"  # has fired; the same contact cannot fire again


@dataclass(frozen=True, slots=True)
class Impact:
    """A hit, on the first sample that shows it.

    `contact_free_until_boot_us` is the latest time at which the vehicle was certainly still free: the start of
    the sample's averaging window, or the previous sample where the stream left a gap before it.
    `specific_force_frd_m_s2` is what the contact alone did to the vehicle, in body axes.
    """

    sample_time_boot_us: int
    contact_free_until_boot_us: int
    specific_force_frd_m_s2: Vector3


@dataclass(frozen=True, slots=True)
class DetectorState:
    """What every detector's state shows; a detector that remembers more extends it.

    `threshold_m_s2` is what a sample must reach now. The three before it describe the present contact, or the
    latest one: time of its last loud sample, the largest contact force per unit mass in one sample so far, and the
    sum of all samples' contact forces, whose direction is the impulse's: a steadier guide to the obstacle's normal
    than any one sample.
    """

    phase: Phase = Phase.OFF
    off_reason: str = "not started"
    last_sample_boot_us: int = 0
    last_loud_boot_us: int = 0
    peak_specific_force_m_s2: float = 0.0
    force_sum_frd_m_s2: Vector3 = (0.0, 0.0, 0.0)
    threshold_m_s2: float = 0.0

    def describe(self) -> str:
        if self.phase is Phase.OFF:
            return f"off ({self.off_reason})"
        return f"{self.phase.value} at {self.threshold_m_s2:.1f} m/s^2"


StateT = TypeVar("StateT", bound=DetectorState)


class Detector(Protocol[StateT]):
    """A detector holds its parameters; all that changes is in the state passed through `step`."""

    name: str

    def initial(self) -> StateT: ...

    def step(self, state: StateT, sample: ImuSample, off_reason: str | None) -> tuple[StateT, Impact | None]:
        """Take one IMU sample; `off_reason` says why a hit may not be reported now, or is None."""
        ...
