"""One flight of a study: what is flown, and what is kept of it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bench.detectors.config import BaselineMission
from bench.fly.lockstep import flown_with_log
from bench.studies.paper.track import Floats, StudyTrack, Vector3, track_of
from companion.report import CollisionReport
from rebound_cli.inputs import with_guards
from rebound_cli.results.flight_log import FlightLog
from rebound_cli.results.summary import FlightFacts, Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

# As the paper's (section V) the vehicle knows itself by flow, range and an extended Kalman filter.
ESTIMATE = {"kind": "ekf"}

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
    """A hit, and what the companion told of it: None where it did not see it. SI units."""

    hit: Hit
    share_received: float
    """Share of the contact that lies in the averaging windows of the samples that were received."""
    fold_before_m: float
    """Greatest fold of any arm just before the first touch, beyond the hysteresis: not yet back from a hit before."""
    told: CollisionReport | None = None
    latency_s: float | None = None
    overshoot_m: float | None = None
    """By the truth, which places the setpoint where the vehicle's own frame was at the first touch."""

    @property
    def impact_speed_m_s(self) -> float:
        return float(np.linalg.norm(self.hit.impact_velocity_ned_m_s))

    @property
    def setpoint_in_world_ned_m(self) -> Vector3 | None:
        """Where the setpoint lay at the first touch, for what is measured from the truth."""
        if self.told is None:
            return None
        x, y, z = np.subtract(self.told.recovery_setpoint_ned_m, self.hit.frame_offset_ned_m).tolist()
        return x, y, z

    @property
    def is_detected(self) -> bool:
        return self.told is not None

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
class StudyResult:
    """What the studies need of a flight."""

    flight: StudyFlight
    contacts: tuple[StudyContact, ...]
    recontacts: int
    """Touches after the first, before the vehicle had recovered, 20 ms or more after the last ended."""
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
    def overshoot_m(self) -> float:
        """The largest."""
        return max((contact.overshoot_m or 0.0 for contact in self.contacts), default=0.0)

    @property
    def overshoot_by_estimate_m(self) -> float:
        return max((contact.told.overshoot_m for contact in self.contacts if contact.told is not None), default=0.0)


def fly(flight: StudyFlight) -> StudyResult:
    """Fly it in lockstep, all MAVLink bytes and the log on."""
    airframe = Airframe.model_validate(with_base({"based_on": flight.airframe, "estimate": ESTIMATE, **flight.changes}))
    mission = BaselineMission.model_validate(with_guards(flight.mission, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": flight.airframe, "seed": flight.seed})
    flown, truth, log = flown_with_log(mission, scene, airframe)
    matches = match_contacts(flown.report.collisions, truth.hits, mission.companion.settled.duration_s)
    interval_us = airframe.imu.integration_interval_us
    return StudyResult(
        flight=flight,
        contacts=tuple(_contacts(flown, truth, log, airframe, mission.companion.settled.duration_s)),
        recontacts=matches.recontacts,
        imu_received_hz=flown.report.stream_rates_hz["HIGHRES_IMU"],
        integration_interval_us=interval_us,
        greatest_lean_rad=_greatest_lean_rad(truth),
        track=track_of(flown, truth, log, scene) if flight.is_drawn and truth.hits else None,
    )


def _contacts(
    flown: Flown, truth: FlightTruth, log: FlightLog, airframe: Airframe, settled_s: float
) -> Iterator[StudyContact]:
    collisions, interval_us = flown.report.collisions, airframe.imu.integration_interval_us
    matches = match_contacts(collisions, truth.hits, settled_s)
    entries = build_summary(flown, FlightFacts("", None, None, settled_s))["collisions"]
    told = zip(matches.hit_of_collision, collisions, entries, strict=True)
    seen = {id(hit): (collision, entry["truth"]) for hit, collision, entry in told if hit is not None}
    for hit in truth.hits:
        fold_m = _fold_before_m(truth, hit, airframe.arms.hysteresis_m)
        contact = StudyContact(hit, share_received(log.imu_time_boot_us, interval_us, hit), fold_m)
        if id(hit) in seen:
            collision, entry = seen[id(hit)]
            late_s, overshoot_m = 1e-3 * entry["detection_latency_ms"], entry["overshoot_m"]
            contact = replace(contact, told=collision, latency_s=late_s, overshoot_m=overshoot_m)
        yield contact


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
