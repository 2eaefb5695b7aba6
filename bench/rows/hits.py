"""What became of a hit in free flight, by the simulator's truth. SI units."""

from time import process_time

import numpy as np

from bench.cases.hits import HitCase
from bench.fly.campaign import Json
from bench.fly.guarded import MOST_RECOVERY_S, fly
from bench.fly.wire import FOUND_WITHIN_US
from bench.rows.contacts import tilts_deg
from bench.rows.recovered import CAME_BACK_M
from companion.reflex.collision import CollisionReport
from rebound_cli.results.truth_match import LATE_SAMPLE_US, FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle


def work_out_flown(case: HitCase) -> Json:
    """Its row by the simulator's truth, and what it cost."""
    began_s = process_time()
    vehicle, guard, rest_us = fly(case)
    processor_s = round(process_time() - began_s, 4)
    return {"processor_s": processor_s, **judged(vehicle, guard.collisions(), rest_us)}


def judged(vehicle: SimulatedVehicle, told: tuple[CollisionReport, ...], rest_us: int | None) -> Json:
    """Found: the companion told of the first contact, or of one that a guard's bounce made soon after."""
    hits, series = vehicle.truth.hits, vehicle.truth.series()
    false = sum(not any(_tells_of(hit, collision) for hit in hits) for collision in told)
    result: Json = {"seconds": round(1e-6 * vehicle.time_boot_us, 3), "false": false, "touched": bool(hits)}
    if not hits:
        return result
    first = hits[0]
    touched_us = first.contact_at_boot_us
    after = series["time_boot_us"] >= touched_us
    late_us = [c.sample_time_boot_us - touched_us for c in told if c.sample_time_boot_us >= touched_us]
    is_found = bool(late_us) and late_us[0] <= FOUND_WITHIN_US
    result |= {
        "found": is_found,
        "closing_m_s": round(first.closing_speed_m_s, 3),
        "tilt_deg": round(float(tilts_deg(series["attitude_wxyz"][after]).max()), 1),
        "lost_m": round(max(0.0, float(series["position_ned_m"][after, 2].max()) - first.contact_position_ned_m[2]), 3),
        "rest_s": None if rest_us is None else round(1e-6 * (rest_us - touched_us), 3),
        "latency_ms": None,
        "again": None,
    }
    if is_found:
        until_s = MOST_RECOVERY_S if rest_us is None else 1e-6 * (rest_us - touched_us)
        result["latency_ms"] = round(1e-3 * late_us[0], 1)
        result["again"] = returns(FlightTruth(hits, series, EPOCH_US), np.array(first.normal_ned), until_s)
    return result


def _tells_of(hit: Hit, collision: CollisionReport) -> bool:
    """While the contact lasts, or as soon after its first touch as the detectors' bench calls it found."""
    until_us = max(hit.ended_at_boot_us + LATE_SAMPLE_US, hit.contact_at_boot_us + FOUND_WITHIN_US)
    return hit.contact_at_boot_us <= collision.sample_time_boot_us <= until_us


def returns(truth: FlightTruth, normal: np.ndarray, until_s: float) -> int:
    """Touches in the recovery to which the centre had come back; the others are another guard swinging in."""
    hit, time_us = truth.hits[0], truth.series["time_boot_us"]
    off_m = truth.series["position_ned_m"] @ normal
    returned = 0
    for touch in truth.hits[1:]:
        if touch.contact_at_boot_us > hit.contact_at_boot_us + 1e6 * until_s:
            break
        between = off_m[(time_us >= hit.ended_at_boot_us) & (time_us <= touch.contact_at_boot_us)]
        returned += len(between) > 0 and float(between.max() - between[-1]) > CAME_BACK_M
    return returned
