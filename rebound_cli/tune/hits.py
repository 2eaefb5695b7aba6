"""The smallest hit a detector sees on a vehicle: hits of the arm model (the paper's eq. 2) put into its flights.

A hit is head-on against a wall, level, from a side drawn evenly around the body: two guards, each by its arm, push
with eq. 2 from the first touch on, at once with b_s v_c. It is added to what the flight's own sensor showed, as its
mean over each sample's own averaging interval or as its low-pass filter lets it through. The flight goes on as if
nothing had happened, its velocity included: what a real hit changes afterwards would only help. So this is a
detector's sight by force alone, in this vibration.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
import numpy.typing as npt

from companion.messages import ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log, low_pass_answer_per_s
from rebound_cli.logs.shaking import FLYING, shaking
from rebound_cli.replay.watching import watch_log
from sim_vehicle.airframe import Airframe
from sim_vehicle.physics.layout import spring_and_damper

Floats = npt.NDArray[np.float64]

# m/s; the mission's own range and below.
SPEEDS_M_S = (0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
# A detector has forgotten a contact and learnt the floor anew after this.
SPACING_US = 2_500_000
# What is left of the log after a hit shows the whole of it.
ROOM_US = 500_000
# Eq. 2's contacts last up to 0.12 s.
FOUND_WITHIN_US = 150_000
LONGEST_CONTACT_S = 0.25
# Fine against the rigid frame's contact of 1 ms.
STEP_S = 1e-5
# Multiples of the golden ratio fall evenly and never repeat: hits anywhere between the samples of a stream at
# PX4's default of 50 Hz, and from anywhere around the body.
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
SLOWEST_INTERVAL_US = 20_000


@dataclass(frozen=True, slots=True)
class HitSensitivity:
    """How many of `hits` put into the flights were seen at each of SPEEDS_M_S, by an airframe at a stream's rate."""

    airframe: str
    rate_hz: float
    hits: int
    seen: tuple[int, ...]

    @property
    def certain_from_m_s(self) -> float | None:
        """From this speed on every hit was seen; None when not even the fastest all were."""
        certain = len(list(takewhile(lambda count: count == self.hits, reversed(self.seen))))
        return SPEEDS_M_S[-certain] if certain else None


def sensitivity(
    logs: Sequence[Log], config: CompanionConfig, airframe: Airframe, asked_hz: float | None
) -> HitSensitivity:
    """Over all flights together; `asked_hz` None for the recorded rate."""
    moments = [list(hit_moments(log)) for log in logs]
    counts = [0] * len(SPEEDS_M_S)
    for index, speed_m_s in enumerate(SPEEDS_M_S):
        impulse = impulse_since_touch(airframe, speed_m_s)
        for log, times_us in zip(logs, moments, strict=True):
            findings = watch_log(with_hits(log, times_us, impulse), config, asked_hz)
            found_us = [finding.at_us for finding in findings.collisions]
            counts[index] += sum(any(t < at_us <= t + FOUND_WITHIN_US for at_us in found_us) for t in times_us)
    rate_hz = asked_hz or min(shaking(log).rate_hz for log in logs)
    return HitSensitivity(airframe.name, rate_hz, sum(map(len, moments)), tuple(counts))


def impulse_since_touch(airframe: Airframe, speed_m_s: float) -> Floats:
    """What a sensor of the airframe's range shows of the hit until each STEP_S after the first touch, m/s.

    Eq. 2's force over the mass, summed; beyond the range it clips, as a rigid frame's does from slow speeds on.
    """
    arms = airframe.arms
    # Two guards share a head-on hit, each with its arm: together they are eq. 2 for the whole vehicle.
    stop_per_s2, stop_per_s = spring_and_damper(arms.stop, mass_kg=1.0)
    depth_m, speed, pushes = 0.0, speed_m_s, [0.0]
    for _ in range(round(LONGEST_CONTACT_S / STEP_S)):
        push = arms.stiffness_per_s2 * depth_m + arms.damping_per_s * speed
        if (beyond_m := depth_m - arms.fold_max_m) >= 0.0:
            push += max(0.0, stop_per_s2 * beyond_m + stop_per_s * speed)
        if push <= 0.0:
            break
        speed -= push * STEP_S
        depth_m += speed * STEP_S
        pushes.append(push)
    return np.cumsum(np.minimum(pushes, airframe.imu.accelerometer_range_m_s2)) * STEP_S


def hit_moments(log: Log) -> Iterator[int]:
    """Times in the air, away from take-off and landing, one each SPACING_US and anywhere among the samples."""
    found = shaking(log)
    due_us, last_us, count = int(found.at_us[0]) + SPACING_US, int(found.at_us[-1]) - ROOM_US, 0
    for at_us, stage in zip(found.at_us.tolist(), found.stages, strict=True):
        if stage not in FLYING:
            due_us = max(due_us, at_us + SPACING_US)
        elif due_us <= at_us <= last_us:
            yield at_us + round(SLOWEST_INTERVAL_US * (count * GOLDEN % 1.0))
            due_us, count = at_us + SPACING_US, count + 1


def with_hits(log: Log, moments_us: Sequence[int], impulse: Floats) -> Log:
    """The log as its sensor would have shown it with a hit at each of the moments."""
    at_us = np.array([time_us for time_us, _ in log.imu()])
    shown = np.concatenate([[0.0], _shown(log, impulse), [0.0]])
    known_us = np.arange(len(shown)) * STEP_S * 1e6
    pushed = np.zeros((len(at_us), 2))
    for number, moment_us in enumerate(moments_us):
        side_rad = 2.0 * math.pi * GOLDEN * number
        taken = np.interp(at_us - moment_us, known_us, shown)
        pushed -= np.outer(taken, (math.cos(side_rad), math.sin(side_rad)))
    pushes = iter(pushed.tolist())
    heard = [
        replace(item, sample=_struck(item.sample, *next(pushes))) if isinstance(item.sample, ImuSample) else item
        for item in log.heard
    ]
    return replace(log, heard=tuple(heard))


def _shown(log: Log, impulse: Floats) -> Floats:
    """The mean over a sample's interval, or the answer of its filter, at each STEP_S after the touch; m/s^2."""
    if log.low_pass_hz is None:
        window_us = log.averaging_us or shaking(log).interval_us
        steps = round(window_us * 1e-6 / STEP_S)
        answer_per_s = np.full(steps, 1.0 / (steps * STEP_S))
    else:
        answer_per_s = low_pass_answer_per_s(log.low_pass_hz, STEP_S)
    answer: Floats = np.convolve(np.diff(impulse), answer_per_s)
    return answer


def _struck(sample: ImuSample, ahead_m_s2: float, aside_m_s2: float) -> ImuSample:
    x, y, z = sample.specific_force_frd_m_s2
    return replace(sample, specific_force_frd_m_s2=(x + ahead_m_s2, y + aside_m_s2, z))
