"""What each detector reported of a hit or a hand, beside the truth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bench.cases.hits import HandCase, HitCase, vehicle_of_hit
from bench.cases.vehicles import BenchVehicle, vehicle_of
from bench.fly.campaign import Json
from bench.fly.cruise import hit_of, hover_in_hand
from bench.fly.wire import (
    ASKED_HZ,
    FOUND_WITHIN_US,
    Found,
    HeardStep,
    VehicleRecording,
    configuration,
    heard,
    streams_asked_hz,
    watch_all,
)
from companion.messages import ImuSample, Vector3
from companion.reflex.impact import ImpactEstimate
from sim_vehicle.truth import Hit

# A force counts as above the noise floor from this many standard deviations of an IMU sample on: of ten hours at
# 250 Hz on three axes, 2.7e7 numbers, noise alone takes one above six with a probability of 0.05.
NOISE_FLOOR_SIGMAS = 6.0
# None of a hit that was not found.
OF_FOUND = ("latency_ms", "samples_late", "speed_error_m_s", "normal_error_deg")


@dataclass(frozen=True, slots=True)
class Possible:
    """The first sample that shows the contact, or None where the contact fell between the samples."""

    time_boot_us: int | None
    imu_times_boot_us: Sequence[int]

    def samples_late(self, found_boot_us: int) -> int | None:
        """How many IMU samples the report came after the first possible one; 0: with it."""
        first = self.time_boot_us
        if first is None:
            return None
        if found_boot_us <= first:
            return 0
        return sum(first < time_us <= found_boot_us for time_us in self.imu_times_boot_us)


def first_possible(
    recording: VehicleRecording, arrived: Sequence[HeardStep], touch_boot_us: float, floor_m_s2: float
) -> Possible:
    """By the truth: the first received sample whose averaging window holds the contact's force above the floor."""
    contact_m_s2 = {
        sample.time_boot_us: force for sample, force in zip(recording.samples, recording.contact_m_s2, strict=True)
    }
    times, first = [], None
    for step in arrived:
        stamps_heard = [sample.time_boot_us for sample in step.samples if isinstance(sample, ImuSample)]
        if not stamps_heard:
            continue
        times.append(step.time_boot_us)
        shows = any(stamp >= touch_boot_us and contact_m_s2[stamp] > floor_m_s2 for stamp in stamps_heard)
        if shows and first is None:
            first = step.time_boot_us
    return Possible(first, times)


def work_out_heard(case: HitCase | HandCase) -> Json:
    """Fly it once, then let every detector hear it at every rate: a row for each."""
    return work_out_hit(case) if isinstance(case, HitCase) else work_out_hand(case)


def work_out_hit(case: HitCase) -> Json:
    """Fly it once, then let every detector hear it at every rate: a row for each."""
    vehicle = vehicle_of_hit(case)
    recording, hit = hit_of(case, vehicle.airframe)
    touch_us = hit.contact_at_boot_us
    floor_m_s2 = NOISE_FLOOR_SIGMAS * vehicle.airframe.imu.accelerometer_noise_m_s2
    truth = {"true_speed_m_s": math.hypot(*hit.impact_velocity_ned_m_s)}
    rows = []
    for rate, arrived in _heard(recording, case.seed):
        possible = first_possible(recording, arrived, touch_us, floor_m_s2)
        possible_ms = None if possible.time_boot_us is None else 1e-3 * (possible.time_boot_us - touch_us)
        for name, (found, touches) in _watched(case.detectors, vehicle, recording, arrived):
            told = sum(touch.impact.sample_time_boot_us >= touch_us for touch in touches)
            entry = _entry(found, hit, possible) | {"touches": told}
            rows.append({**truth, "rate": rate, "possible_ms": possible_ms, "detector": name, **entry})
    return {"rows": rows}


def work_out_hand(case: HandCase) -> Json:
    """Hold it once, then let every detector hear it at every rate: a row for each."""
    vehicle = vehicle_of(case.airframe, case.seed if case.is_drawn else None)
    recording, began_us = hover_in_hand(case, vehicle.airframe)
    rows = []
    for rate, arrived in _heard(recording, case.seed):
        for name, (found, touches) in _watched(case.detectors, vehicle, recording, arrived):
            told_us = [t.impact.sample_time_boot_us for t in touches if t.impact.sample_time_boot_us >= began_us]
            kinds, late_ms = [f.final.impact.kind.value for f in found], [1e-3 * (t - began_us) for t in told_us]
            entry = {"collisions": kinds, "told_after_ms": late_ms[0] if late_ms else None}
            rows.append({"rate": rate, "detector": name, **entry})
    return {"rows": rows}


def _heard(recording: VehicleRecording, seed: int) -> Iterator[tuple[int, list[HeardStep]]]:
    """By rate."""
    for rate in ASKED_HZ:
        yield rate, heard(recording, streams_asked_hz(rate), seed + rate)


def _watched(
    detectors: Sequence[str], vehicle: BenchVehicle, recording: VehicleRecording, arrived: Sequence[HeardStep]
) -> Iterator[tuple[str, tuple[list[Found], list[ImpactEstimate]]]]:
    for name in detectors:
        yield name, watch_all(configuration(name, vehicle.settings), arrived, recording.situations)


def _entry(found: Sequence[Found], hit: Hit, possible: Possible) -> Json:
    """One detector's report on one hit."""
    touch_us = hit.contact_at_boot_us
    false = sum(f.time_boot_us < touch_us for f in found)
    first = next((f for f in found if touch_us <= f.time_boot_us <= touch_us + FOUND_WITHIN_US), None)
    if first is None:
        return {"false": false, "evidence": None, **dict.fromkeys(OF_FOUND)}
    velocity, true_velocity = first.final.velocity_ned_m_s, hit.impact_velocity_ned_m_s
    return {
        "false": false,
        "latency_ms": 1e-3 * (first.time_boot_us - touch_us),
        "samples_late": possible.samples_late(first.time_boot_us),
        "evidence": first.first.impact.evidence.value,
        "speed_error_m_s": math.hypot(*velocity) - math.hypot(*true_velocity),
        "normal_error_deg": angle_deg(first.final.normal.direction_ned, hit.normal_ned),
    }


def angle_deg(one: Vector3, other: Vector3) -> float:
    lengths = math.hypot(*one) * math.hypot(*other)
    if lengths == 0.0:
        return 180.0
    cosine = sum(a * b for a, b in zip(one, other, strict=True)) / lengths
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
