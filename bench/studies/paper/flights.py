"""One flight of a study: what is flown, and what is kept of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.detectors.config import BaselineMission
from bench.fly.lockstep import flown_with_log
from rebound_cli.inputs import with_guards
from rebound_cli.results.flight_log import FlightLog
from rebound_cli.results.summary import FlightFacts, Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]
Vector3 = tuple[float, float, float]

# As the paper's (section V) the vehicle knows itself by flow, range and an extended Kalman filter.
ESTIMATE = {"kind": "ekf"}

# What is kept of a flight that is to be drawn, around its first contact.
TRACK_BEFORE_S, TRACK_AFTER_S = 2.0, 8.0
# Of an arm that is on its way: an arm that rests on its hysteresis is there to the last bit.
LEAST_FOLD_M = 1e-6
# The hit turns the vehicle, the attitude loop turns it back: all of that is over within a second.
LEAN_LOOKED_AT_S = 1.0


@dataclass(frozen=True, slots=True)
class StudyFlight:
    """A mission's content, an airframe (a built-in one with changes) and a seed; `key` is the study's own."""

    key: tuple[Any, ...]
    mission: Mapping[str, Any]
    airframe: str
    seed: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    is_drawn: bool = False


@dataclass(frozen=True, slots=True)
class StudyContact:
    """A hit, and what the companion made of it: None where it did not see it. SI units."""

    hit: Hit
    share_received: float
    """Share of the contact that lies in the averaging windows of the samples that were received."""
    latency_s: float | None
    impact_speed_estimate_m_s: float | None
    setpoint_ned_m: Vector3 | None
    """In the vehicle's own frame, like the next."""
    position_estimate_ned_m: Vector3 | None
    overshoot_m: float | None
    """By the truth, which places the setpoint where the vehicle's own frame was at the first touch."""
    overshoot_by_estimate_m: float | None
    fold_before_m: float
    """Greatest fold of any arm just before the first touch, beyond the hysteresis: not yet back from a hit before."""

    @property
    def impact_speed_m_s(self) -> float:
        return float(np.linalg.norm(self.hit.impact_velocity_ned_m_s))

    @property
    def setpoint_in_world_ned_m(self) -> Vector3 | None:
        """Where the setpoint lay at the first touch, for what is measured from the truth."""
        if self.setpoint_ned_m is None:
            return None
        x, y, z = np.subtract(self.setpoint_ned_m, self.hit.frame_offset_ned_m).tolist()
        return x, y, z

    @property
    def is_detected(self) -> bool:
        return self.latency_s is not None

    @property
    def is_approach(self) -> bool:
        """Whether the centre moved towards the wall at the first touch; a swinging guard touches while it leaves."""
        return float(np.dot(self.hit.impact_velocity_ned_m_s, self.hit.normal_ned)) < 0.0

    @property
    def is_end_of_the_one_before(self) -> bool:
        """Whether another guard swings in while the vehicle leaves and its arms still unfold.

        The paper's collision is over when l <= delta l after its peak (section IV), not when the force is.
        """
        return self.fold_before_m > 0.0 and not self.is_approach


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


@dataclass(frozen=True, slots=True)
class StudyResult:
    """What the studies need of a flight."""

    flight: StudyFlight
    is_completed: bool
    contacts: tuple[StudyContact, ...]
    recontacts: int
    """Touches after the first, before the vehicle had recovered, 20 ms or more after the last ended."""
    false_detections: int
    imu_received_hz: float
    integration_interval_us: int
    greatest_lean_rad: float
    """Of the thrust towards the wall in the second after the first touch: what presses the vehicle back on."""
    track: StudyTrack | None

    @property
    def first(self) -> StudyContact:
        return self.contacts[0]

    @property
    def second_hits(self) -> int:
        """Of `recontacts`, those that are not the end of the collision before."""
        return self.recontacts - sum(contact.is_end_of_the_one_before for contact in self.contacts[1:])

    @property
    def overshoots_m(self) -> list[float]:
        return [contact.overshoot_m for contact in self.contacts if contact.overshoot_m is not None]

    @property
    def overshoots_by_estimate_m(self) -> list[float]:
        past_m = (contact.overshoot_by_estimate_m for contact in self.contacts)
        return [each_m for each_m in past_m if each_m is not None]


def fly(flight: StudyFlight) -> StudyResult:
    """Fly it in lockstep, all MAVLink bytes and the log on."""
    airframe = Airframe.model_validate(with_base({"based_on": flight.airframe, "estimate": ESTIMATE, **flight.changes}))
    mission = BaselineMission.model_validate(with_guards(flight.mission, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": flight.airframe, "seed": flight.seed})
    flown, truth, log = flown_with_log(mission, scene, airframe)
    settled_duration_s = mission.companion.settled.duration_s
    matches = match_contacts(flown.report.collisions, truth.hits, settled_duration_s)
    interval_us = airframe.imu.integration_interval_us
    return StudyResult(
        flight=flight,
        is_completed=flown.report.outcome == "completed",
        contacts=_contacts(flown, truth, log, airframe, settled_duration_s),
        recontacts=matches.recontacts,
        false_detections=matches.false_detections,
        imu_received_hz=flown.report.stream_rates_hz["HIGHRES_IMU"],
        integration_interval_us=interval_us,
        greatest_lean_rad=_greatest_lean_rad(truth),
        track=_track(flown, truth, log, scene) if flight.is_drawn and truth.hits else None,
    )


def _contacts(
    flown: Flown, truth: FlightTruth, log: FlightLog, airframe: Airframe, settled_duration_s: float
) -> tuple[StudyContact, ...]:
    collisions = flown.report.collisions
    matches = match_contacts(collisions, truth.hits, settled_duration_s)
    entries = build_summary(flown, FlightFacts("", None, None, settled_duration_s))["collisions"]
    number_of = {id(hit): number for number, hit in enumerate(matches.hit_of_collision) if hit is not None}
    contacts = []
    for hit in truth.hits:
        number = number_of.get(id(hit))
        collision = None if number is None else collisions[number]
        seen = None if number is None else entries[number]["truth"]
        contacts.append(
            StudyContact(
                hit=hit,
                share_received=share_received(log.imu_time_boot_us, airframe.imu.integration_interval_us, hit),
                latency_s=None if seen is None else 1e-3 * seen["detection_latency_ms"],
                impact_speed_estimate_m_s=None if collision is None else collision.impact_speed_m_s,
                setpoint_ned_m=None if collision is None else collision.recovery_setpoint_ned_m,
                position_estimate_ned_m=None if collision is None else collision.position_ned_m,
                overshoot_m=None if seen is None else seen["overshoot_m"],
                overshoot_by_estimate_m=None if collision is None else collision.overshoot_m,
                fold_before_m=_fold_before_m(truth, hit, airframe.arms.hysteresis_m),
            )
        )
    return tuple(contacts)


def _fold_before_m(truth: FlightTruth, hit: Hit, hysteresis_m: float) -> float:
    before = int(np.searchsorted(truth.series["time_boot_us"], hit.contact_at_boot_us)) - 1
    beyond_m = float(truth.series["arm_fold_m"][before].max()) - hysteresis_m
    return beyond_m if beyond_m > LEAST_FOLD_M else 0.0


def share_received(sample_times_boot_us: Floats, interval_us: int, hit: Hit) -> float:
    """Share of a contact covered by the windows (of `interval_us`, ending at the sample's time) that arrived."""
    start, end = hit.contact_at_boot_us, hit.ended_at_boot_us
    covered = np.minimum(sample_times_boot_us, end) - np.maximum(sample_times_boot_us - interval_us, start)
    return float(np.clip(covered, 0.0, None).sum() / max(end - start, 1.0))


def _greatest_lean_rad(truth: FlightTruth) -> float:
    if not truth.hits:
        return 0.0
    hit = truth.hits[0]
    since_s = 1e-6 * (truth.series["time_boot_us"] - hit.contact_at_boot_us)
    w, x, y, z = truth.series["attitude_wxyz"][(since_s >= 0.0) & (since_s <= LEAN_LOOKED_AT_S)].T
    thrust_ned = -np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return float(np.arcsin(np.clip(-np.array(hit.normal_ned) @ thrust_ned, -1.0, 1.0)).max())


def _track(flown: Flown, truth: FlightTruth, log: FlightLog, scene: Scene) -> StudyTrack:
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
