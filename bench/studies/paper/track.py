"""What is drawn of a flight: its way into the wall that it hit first."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rebound_cli.results.flight_log import FlightLog
from rebound_cli.results.summary import Flown
from rebound_cli.results.truth_match import FlightTruth
from sim_vehicle.scene import Scene

Floats = npt.NDArray[np.float64]
Vector3 = tuple[float, float, float]

# What is kept of a flight that is to be drawn, around its first contact.
TRACK_BEFORE_S, TRACK_AFTER_S = 2.0, 8.0


@dataclass(frozen=True, slots=True)
class StudyTrack:
    """A flight along the line into the wall that it hit first. Seconds since that contact; metres, m/s.

    Places count from the take-off point, into the wall positive.
    """

    time_s: Floats
    place_m: Floats
    speed_m_s: Floats
    fold_m: Floats
    setpoint_at_s: Floats
    setpoint_m: Floats
    touch_m: float
    """Where the vehicle's centre was at the first touch."""
    wall_m: float
    contacts_s: tuple[float, ...]
    detections_s: tuple[float, ...]
    targets_m: tuple[float, ...]
    """The recovery setpoint of each detection."""


def track_of(flown: Flown, truth: FlightTruth, log: FlightLog, scene: Scene) -> StudyTrack:
    report, hit = flown.report, truth.hits[0]
    into_wall = -np.array(hit.normal_ned)
    # What the vehicle was told lies in its own frame, and is drawn where that was at the first touch.
    offset = np.array(hit.frame_offset_ned_m)
    origin = np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    wall = next(wall for wall in scene.walls_built() if wall.name == hit.obstacle)
    zero_us = hit.contact_at_boot_us

    def seconds(at_us: Floats) -> Floats:
        since: Floats = 1e-6 * (at_us - truth.epoch_at_boot_us - zero_us)
        return since

    def place_m(position_ned_m: Vector3) -> float:
        return float((np.array(position_ned_m) - origin) @ into_wall)

    time_s = 1e-6 * (truth.series["time_boot_us"] - zero_us)
    kept = (time_s >= -TRACK_BEFORE_S) & (time_s <= TRACK_AFTER_S)
    setpoint_at_s = seconds(log.setpoint_at_us)
    asked = (setpoint_at_s >= -TRACK_BEFORE_S) & (setpoint_at_s <= TRACK_AFTER_S)
    return StudyTrack(
        time_s=time_s[kept],
        place_m=(truth.series["position_ned_m"][kept] - origin) @ into_wall,
        speed_m_s=truth.series["velocity_ned_m_s"][kept] @ into_wall,
        fold_m=truth.series["arm_fold_m"][kept],
        setpoint_at_s=setpoint_at_s[asked],
        setpoint_m=(log.setpoint_ned_m[asked] - offset - origin) @ into_wall,
        touch_m=place_m(hit.contact_position_ned_m),
        wall_m=place_m(wall.point_ned_m),
        contacts_s=tuple(1e-6 * (each.contact_at_boot_us - zero_us) for each in truth.hits),
        detections_s=tuple(1e-6 * (each.sample_time_boot_us - zero_us) for each in report.collisions),
        targets_m=tuple(
            place_m(each.recovery_setpoint_ned_m) - float(offset @ into_wall) for each in report.collisions
        ),
    )
