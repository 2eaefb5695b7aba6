"""`summary.json`: what the companion says of a flight beside what the simulator knows; docs/reference/summary.md."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from companion.errors import ReboundError
from companion.memory.stored import as_data
from companion.report import FlightReport
from companion.shell.connections.peer import LinkCounts
from rebound_cli.results.timing import Timing
from rebound_cli.results.truth_match import FlightTruth, match_contacts

if TYPE_CHECKING:
    from sim_vehicle.truth import Hit

SCHEMA = 1

# Sizes are written to a tenth of a millimetre, times to a microsecond: finer digits are noise.
_DIGITS = 4
_TIME_DIGITS = 6

# How long overshoot and loss of height are looked at when a recovery has not ended before.
LONGEST_RECOVERY_S = 10.0


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that is over; without truth when the vehicle was a real one."""

    report: FlightReport
    wall_clock_s: float
    truth: FlightTruth | None
    timing: Timing | None = None  # None in lockstep, which knows no real time
    refused_packets: Mapping[str, int] = field(default_factory=dict)  # by reason; see mavlink/signing.py
    link: LinkCounts = field(default_factory=LinkCounts)
    fault: ReboundError | None = None  # of the program around the flight


def build_summary(
    flown: Flown, settled_s: float, mission: str, airframe: str | None, seed: int | None
) -> dict[str, Any]:
    """The content of summary.json. Without truth everything that needs it is null.

    A vehicle counts as recovered that has stayed settled for `settled_s`; a real one has no `airframe` and no `seed`.
    """
    report, truth = flown.report, flown.truth
    duration_s = (report.ended_at_us - report.started_at_us) / 1e6
    matches = match_contacts(report.collisions, truth, settled_s) if truth else None
    hits = matches.hit_of_collision if matches else (None,) * len(report.collisions)
    return {
        "schema": SCHEMA,
        "mission": mission,
        "outcome": report.outcome if flown.fault is None else "failed",
        "reason": report.reason if flown.fault is None else str(flown.fault),
        "autopilot": report.autopilot,
        "seed": seed,
        "airframe": airframe,
        "duration_s": round(duration_s, _TIME_DIGITS),
        "wall_clock_s": round(flown.wall_clock_s, 3),
        "realtime_factor": round(duration_s / flown.wall_clock_s, 3) if flown.wall_clock_s > 0 else None,
        **(flown.timing or Timing()).summary(),
        "stream_rates_hz": {name: round(rate, 2) for name, rate in report.stream_rates_hz.items()},
        "round_trip_ms": dict(report.round_trip_ms),
        **asdict(flown.link),
        "refused_messages": dict(report.refused_messages),
        "refused_packets": dict(flown.refused_packets),
        "unconfirmed": report.unconfirmed,
        "crashed": report.crashed or None,
        "promise": None if report.promise is None else report.promise.summary(),
        "false_detections": matches.false_detections if matches else None,
        "missed_contacts": matches.missed_contacts if matches else None,
        "recontacts": matches.recontacts if matches else None,
        "expectations": [
            {"item": wish.label, "expected": wish.text, "met": wish.met, "was": wish.detail}
            for wish in report.expectations
        ],
        "obstacles": [as_data(patch) for patch in report.obstacles],
        "unreachable": list(report.unreachable),
        "collisions": [
            {
                **_collision(report, number),
                "truth": _truth(report, number, settled_s, hit, truth) if truth and hit else None,
            }
            for number, hit in enumerate(hits)
        ],
    }


def _collision(report: FlightReport, number: int) -> dict[str, Any]:
    collision = report.collisions[number]
    felt = ("impact_velocity_ned_m_s", "impact_speed_m_s", "normal_ned", "peak_specific_force_m_s2")
    return {
        "detected_at_s": _seconds(collision.detected_at_us - report.started_at_us),
        "detector": collision.detector,
        **_rounded(collision, *felt, "recovery_setpoint_ned_m"),
        **_rounded(collision, "settled_after_s", digits=_TIME_DIGITS),
        **_rounded(collision, "overshoot_m", "rebound_speed_m_s"),
        "stopped_off_m": _between(collision.position_ned_m, collision.recovery_setpoint_ned_m, collision.normal_ned),
    }


def _truth(report: FlightReport, number: int, settled_s: float, hit: "Hit", truth: FlightTruth) -> Mapping[str, Any]:
    collision = report.collisions[number]
    contact_at_us = truth.at_us(hit.contact_at_boot_us)
    # When it was called recovered, or the next hit was detected, or the longest time looked at was over.
    recovered_s = LONGEST_RECOVERY_S if collision.settled_after_s is None else collision.settled_after_s + settled_s
    following_us = (later.detected_at_us for later in report.collisions[number + 1 :])
    end_us = min(collision.detected_at_us + recovered_s * 1e6, report.ended_at_us, *following_us)
    end_boot_us = hit.contact_at_boot_us + end_us - contact_at_us
    overshoot_m, height_lost_m = truth.past_setpoint_and_below(hit, collision.recovery_setpoint_ned_m, end_boot_us)
    believed_ned_m = tuple(map(sum, zip(hit.contact_position_ned_m, hit.frame_offset_ned_m, strict=True)))
    return {
        "kind": hit.kind,
        "contact_at_s": _seconds(contact_at_us - report.started_at_us),
        "detection_latency_ms": round((collision.detected_at_us - contact_at_us) / 1e3, 3),
        **_rounded(hit, "impact_velocity_ned_m_s", "normal_ned"),
        **_rounded(hit, "contact_duration_s", "max_fold_m", digits=_TIME_DIGITS),
        **_rounded(hit, "rebound_speed_m_s"),
        "peak_force_n": round(hit.peak_force_n, 2),
        "impulse_n_s": round(math.hypot(*hit.impulse_ned_n_s), _DIGITS),
        **_rounded(hit, "energy_before_j", "energy_after_j"),
        "overshoot_m": round(overshoot_m, _DIGITS),
        "height_lost_m": round(height_lost_m, _DIGITS),
        "stopped_off_m": _between(believed_ned_m, collision.recovery_setpoint_ned_m, hit.normal_ned),
    }


def _between(from_ned_m: Sequence[float], to_ned_m: Sequence[float], normal_ned: Sequence[float]) -> float:
    """How far one place is from another along a surface's normal, out of it positive."""
    steps = zip(from_ned_m, to_ned_m, normal_ned, strict=True)
    return round(sum((to_m - from_m) * axis for from_m, to_m, axis in steps), _DIGITS)


def _seconds(time_us: float) -> float:
    return round(time_us / 1e6, _TIME_DIGITS)


def _rounded(what: object, *names: str, digits: int = _DIGITS) -> dict[str, Any]:
    """Its numbers and vectors of these names; None stays None."""
    found = {name: getattr(what, name) for name in names}
    return {
        name: [round(axis, digits) for axis in value] if isinstance(value, tuple) else value and round(value, digits)
        for name, value in found.items()
    }
