"""The companion's collisions beside the simulator's contacts. Definitions in docs/reference/summary.md."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

from companion.reflex.recovery.collision import CollisionReport
from rebound_cli.results.run_folder import reading

if TYPE_CHECKING:  # a flight with a real vehicle must not wait for the simulator's compiled kernels
    from sim_vehicle.truth import Hit

# A contact that falls between the IMU samples shows in the velocities after it: two intervals of ODOMETRY's 30 Hz, and
# the estimate's delay of 20 to 40 ms.
LATE_SAMPLE_US = 100_000

Time = TypeVar("Time", float, npt.NDArray[np.float64])
Series = dict[str, npt.NDArray[np.float64]]
Vector3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FlightTruth:
    """What the simulator knows of a flight. `epoch_at_boot_us` is when the vehicle's boot clock read 0, by its end.

    `stalls` are boot times at which the simulator stood still, and for how long: before one of them, boot time 0 was
    by so much earlier. `jumps` are boot times from which on the vehicle told later ones, and by how much.
    """

    hits: "Sequence[Hit]"
    series: Series
    epoch_at_boot_us: float
    stalls: Sequence[tuple[int, int]] = ()
    jumps: Sequence[tuple[int, int]] = ()

    def at_us(self, boot_us: Time) -> Time:
        """The companion's clock at a time, or at times, of the vehicle's."""
        earlier = sum(late_us * (boot_us < at_us) for at_us, late_us in self.stalls)
        return boot_us + self.epoch_at_boot_us - earlier

    def told_us(self, boot_us: Time) -> Time:
        """What the vehicle's messages had for a time, or times, of its clock."""
        return boot_us + sum(later_us * (boot_us >= at_us) for at_us, later_us in self.jumps)

    def index_of_hit(self, sample_time_boot_us: int) -> int | None:
        """The latest contact that had begun when the sample's window ended, as told, and was not long over."""
        for index in range(len(self.hits) - 1, -1, -1):
            hit = self.hits[index]
            ended_us = self.told_us(hit.ended_at_boot_us)
            if self.told_us(hit.contact_at_boot_us) <= sample_time_boot_us <= ended_us + LATE_SAMPLE_US:
                return index
        return None

    def past_setpoint_and_below(self, hit: "Hit", setpoint_ned_m: Vector3, until_boot_us: float) -> tuple[float, float]:
        """Furthest distance past the setpoint along the wall's normal and greatest loss of height, in metres.

        Looked at from the contact until `until_boot_us`. The setpoint is in the vehicle's own frame, which dead
        reckoning lets drift; its place in the world is where that frame was at the contact.
        """
        time_us = self.series["time_boot_us"]
        during = (time_us >= hit.contact_at_boot_us) & (time_us <= until_boot_us)
        position_ned_m = self.series["position_ned_m"][during]
        if len(position_ned_m) == 0:
            return 0.0, 0.0
        place_ned_m = np.array(setpoint_ned_m) - np.array(hit.frame_offset_ned_m)
        past_m = (position_ned_m - place_ned_m) @ np.array(hit.normal_ned)
        lost_m = position_ned_m[:, 2] - hit.contact_position_ned_m[2]
        return max(float(past_m.max()), 0.0), max(float(lost_m.max()), 0.0)


def read_truth(path: Path) -> FlightTruth | None:
    """None where a simulator has left none: of a real vehicle, or of a PX4 that never flew. Raises RunFolderError."""
    if not path.exists():
        return None
    from sim_vehicle.shell.truth_file import load_clock, load_truth

    with reading(path):
        return FlightTruth(*load_truth(path), *load_clock(path))


@dataclass(frozen=True, slots=True)
class Matches:
    """Which contact each collision of the report was, and the counts of what did not fit."""

    hit_of_collision: "tuple[Hit | None, ...]"
    false_detections: int
    missed_contacts: int
    recontacts: int


def match_contacts(collisions: Sequence[CollisionReport], truth: FlightTruth, settled_duration_s: float) -> Matches:
    """Match on the vehicle's boot clock: a detection belongs to the contact that its IMU sample covers, one to one.

    The companion calls a vehicle recovered that has stayed settled for `settled_duration_s`.
    """
    hits, collision_of_hit = truth.hits, dict[int, CollisionReport]()
    hit_of_collision: list[Hit | None] = []
    for collision in collisions:
        index = truth.index_of_hit(collision.sample_time_boot_us)
        is_new = index is not None and collision_of_hit.setdefault(index, collision) is collision
        hit_of_collision.append(hits[index] if index is not None and is_new else None)
    began_us = [truth.told_us(hit.contact_at_boot_us) for hit in hits]
    recontacts = sum(
        not _is_recovered(collision_of_hit.get(index - 1), began_us[index], settled_duration_s)
        for index in range(1, len(hits))
    )
    missed = len(hits) - len(collision_of_hit)
    return Matches(tuple(hit_of_collision), hit_of_collision.count(None), missed, recontacts)


def _is_recovered(collision: CollisionReport | None, at_boot_us: float, settled_duration_s: float) -> bool:
    """Whether the companion had called the collision recovered by then; an unseen one never is."""
    if collision is None or collision.settled_after_s is None:
        return False
    recovered_after_us = (collision.settled_after_s + settled_duration_s) * 1e6
    return at_boot_us >= collision.sample_time_boot_us + recovered_after_us
