"""The row of a flight of the paper: into a wall, by the truth and by what the companion reported. SI units."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.detectors.config import BaselineMission
from bench.fly.campaign import Json
from bench.fly.lockstep import flown_in
from companion.report import FlightReport
from rebound_cli.inputs.inputs import with_guards
from rebound_cli.results.flight_log import FlightLog, read_flight_log
from rebound_cli.results.run_folder import TLOG_NAME
from rebound_cli.results.summary import build_summary
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# As the paper's (section V) the vehicle knows itself by flow, range and an extended Kalman filter.
ESTIMATE = {"kind": "ekf"}
# A hit counts as lost on the way when less than this share of it lies in samples that arrived: a tenth of a
# millisecond, clipped at 157 m/s^2, adds 3.9 m/s^2 to a mean over 4 ms, just below the detector's threshold.
LOST_SHARE = 0.1
# Of an arm that is on its way: an arm that rests on its hysteresis is there to the last bit.
LEAST_FOLD_M = 1e-6
# The paper's stress analysis (section II) of its frame: a factor of safety of 1.85 at 100 N.
BREAKING_FORCE_N = 185.0
# What is kept of a flight that is to be drawn, around its first contact.
TRACK_BEFORE_S, TRACK_AFTER_S = 2.0, 8.0


@dataclass(frozen=True, slots=True)
class StudyFlight:
    """A mission's content, an airframe (a built-in one with changes) and a seed; `names` are a study's columns."""

    names: Mapping[str, Any]
    mission: Mapping[str, Any]
    airframe: str
    seed: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    is_drawn: bool = False
    study: str = ""


def fly(flight: StudyFlight) -> Json:
    """Fly it in lockstep, all MAVLink bytes and the log on.

    `seen`: the first hit was detected; `lost`: it lies in no sample that arrived. `again`: touches after the first,
    before the vehicle had recovered; `second_hits`: those that are not the end of the collision before. What needs a
    hit, or a detection, is missing without one.
    """
    airframe = Airframe.model_validate(with_base({"based_on": flight.airframe, "estimate": ESTIMATE, **flight.changes}))
    mission = BaselineMission.model_validate(with_guards(flight.mission, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": flight.airframe, "seed": flight.seed})
    with tempfile.TemporaryDirectory() as folder:
        flown, _ = flown_in(Path(folder), mission, scene, airframe)
        log = read_flight_log(Path(folder) / TLOG_NAME)
    truth = flown.truth
    assert truth is not None, "a lockstep flight has its truth"
    report, settled_s = flown.report, mission.companion.settled.duration_s
    matches = match_contacts(report.collisions, truth, settled_s)
    row = {
        "study": flight.study,
        **flight.names,
        "airframe": flight.airframe,
        "seed": flight.seed,
        "imu_hz": report.stream_rates_hz["HIGHRES_IMU"],
        "interval_us": airframe.imu.integration_interval_us,
        "hits": len(truth.hits),
        "again": matches.recontacts,
        "seen": False,
        "track": _track(report, truth, log, scene) if flight.is_drawn and truth.hits else None,
    }
    if not truth.hits:
        return row
    entries = build_summary(flown, settled_s, "", None, None)["collisions"]
    told = zip(matches.hit_of_collision, report.collisions, entries, strict=True)
    matched = [(hit, collision, entry["truth"]) for hit, collision, entry in told if hit is not None]
    row |= _of_hits(truth, airframe.arms.hysteresis_m, matches.recontacts)
    row["lost"] = share_received(log.imu_time_boot_us, row["interval_us"], truth.hits[0]) < LOST_SHARE
    row["past_m"] = max((beside["overshoot_m"] or 0.0 for _, _, beside in matched), default=0.0)
    row["own_past_m"] = max((collision.overshoot_m for _, collision, _ in matched), default=0.0)
    first = truth.hits[0]
    for hit, collision, beside in matched:
        if hit is first:
            # What the vehicle was told lies in its own frame; in the world that was here at the first touch.
            setpoint = np.subtract(collision.recovery_setpoint_ned_m, hit.frame_offset_ned_m)
            row |= {
                "seen": True,
                "latency_s": 1e-3 * beside["detection_latency_ms"],
                "told_m_s": collision.impact_speed_m_s,
                "setpoint_m": setpoint.tolist(),
                "told_back_m": None
                if collision.position_ned_m is None
                else collision.position_ned_m[0] - collision.recovery_setpoint_ned_m[0],
            }
    return row


def _of_hits(truth: FlightTruth, hysteresis_m: float, again: int) -> Json:
    """By the truth alone."""
    first, *later = truth.hits
    folds_m = [_fold_before_m(truth, hit, hysteresis_m) for hit in later]
    ends = [ends_the_one_before(hit, fold_m) for hit, fold_m in zip(later, folds_m, strict=True)]
    impact_m_s = float(np.linalg.norm(first.impact_velocity_ned_m_s))
    return {
        "contact_m": list(first.contact_position_ned_m),
        "contact_s": first.contact_duration_s,
        "impact_m_s": impact_m_s,
        "rebound_m_s": first.rebound_speed_m_s,
        "peak_n": max(hit.peak_force_n for hit in truth.hits),
        "second_hits": again - sum(ends),
    }


def ends_the_one_before(hit: Hit, fold_before_m: float) -> bool:
    """Whether another guard swings in while the vehicle leaves and its arms still unfold.

    The paper's collision is over when l <= delta l after its peak (section IV), not when the force is.
    """
    leaves = float(np.dot(hit.impact_velocity_ned_m_s, hit.normal_ned)) >= 0.0
    return fold_before_m > 0.0 and leaves


def _fold_before_m(truth: FlightTruth, hit: Hit, hysteresis_m: float) -> float:
    """Greatest fold of any arm just before the touch, beyond the hysteresis: not yet back from a hit before."""
    before = int(np.searchsorted(truth.series["time_boot_us"], hit.contact_at_boot_us)) - 1
    beyond_m = float(truth.series["arm_fold_m"][before].max()) - hysteresis_m
    return beyond_m if beyond_m > LEAST_FOLD_M else 0.0


def share_received(sample_times_boot_us: Floats, interval_us: int, hit: Hit) -> float:
    """Share of a contact covered by the windows (of `interval_us`, ending at the sample's time) that arrived."""
    start, end = hit.contact_at_boot_us, hit.ended_at_boot_us
    covered = np.minimum(sample_times_boot_us, end) - np.maximum(sample_times_boot_us - interval_us, start)
    return float(np.clip(covered, 0.0, None).sum() / max(end - start, 1.0))


def _track(report: FlightReport, truth: FlightTruth, log: FlightLog, scene: Scene) -> Json:
    """The flight along the line into the wall that it hit first, to be drawn.

    Seconds since that contact; metres from the take-off point, into the wall positive.
    """
    hit = truth.hits[0]
    into_wall = -np.array(hit.normal_ned)
    # What the vehicle was told lies in its own frame, and is drawn where that was at the first touch.
    offset, origin = np.array(hit.frame_offset_ned_m), np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    wall = next(wall for number, wall in enumerate(scene.walls, 1) if wall.built(number).name == hit.obstacle)
    zero_us = hit.contact_at_boot_us

    def along_m(places_ned_m: Any) -> Any:
        return ((np.array(places_ned_m).reshape(-1, 3) - origin) @ into_wall).tolist()

    def is_kept(times_s: Floats) -> Any:
        return (times_s >= -TRACK_BEFORE_S) & (times_s <= TRACK_AFTER_S)

    time_s = 1e-6 * (truth.series["time_boot_us"] - zero_us)
    sent_s = 1e-6 * (log.setpoint_at_us - truth.epoch_at_boot_us - zero_us)
    kept, sent = is_kept(time_s), is_kept(sent_s)
    return {
        "time_s": time_s[kept].tolist(),
        "place_m": along_m(truth.series["position_ned_m"][kept]),
        "speed_m_s": (truth.series["velocity_ned_m_s"][kept] @ into_wall).tolist(),
        "fold_m": truth.series["arm_fold_m"][kept].tolist(),
        "setpoint_at_s": sent_s[sent].tolist(),
        "setpoint_m": along_m(log.setpoint_ned_m[sent] - offset),
        "touch_m": along_m(hit.contact_position_ned_m)[0],
        "wall_m": along_m(wall.point_ned_m)[0],
        "contacts_s": [1e-6 * (each.contact_at_boot_us - zero_us) for each in truth.hits],
        "detections_s": [1e-6 * (each.sample_time_boot_us - zero_us) for each in report.collisions],
        "targets_m": along_m([np.subtract(each.recovery_setpoint_ned_m, offset) for each in report.collisions]),
    }
