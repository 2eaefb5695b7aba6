"""The smallest hit a detector sees on a vehicle: hits of the arm model (the paper's eq. 2) put into its flights.

A hit is head-on against a wall, level, from a side drawn evenly around the body: two guards, each by its arm, push
with eq. 2 from the first touch on, at once with b_s v_c. It is added to what the flight's own sensor showed, as its
mean over each sample's own averaging interval. The flight goes on as if nothing had happened, its velocity included:
what a real hit changes afterwards would only help. So this is a detector's sight by force alone, in this vibration.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from companion.messages import ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Heard, Log
from rebound_cli.logs.shaking import Stage, shaking
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
# Fine against the rigid frame's contact of 1 ms.
STEP_S = 1e-5
LONGEST_CONTACT_S = 0.25
# Multiples of the golden ratio fall evenly and never repeat: hits anywhere between the samples of a stream at
# PX4's default of 50 Hz, and from anywhere around the body.
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
SLOWEST_INTERVAL_US = 20_000
TURN_RAD = 2.0 * math.pi * GOLDEN


@dataclass(frozen=True, slots=True)
class Sight:
    """How many of `hits` put into the flights were seen at each of SPEEDS_M_S, by an airframe at a stream's rate."""

    airframe: str
    rate_hz: float
    hits: int
    seen: tuple[int, ...]

    @property
    def certain_from_m_s(self) -> float | None:
        """From this speed on every hit was seen; None when not even the fastest all were."""
        certain = None
        for speed_m_s, count in zip(reversed(SPEEDS_M_S), reversed(self.seen), strict=True):
            if count < self.hits:
                break
            certain = speed_m_s
        return certain


def sight(logs: Sequence[Log], config: CompanionConfig, airframe: Airframe, asked_hz: float | None) -> Sight:
    """Over all flights together; `asked_hz` None for the recorded rate."""
    moments = [list(hit_moments(log)) for log in logs]
    counts = []
    for speed_m_s in SPEEDS_M_S:
        impulse = impulse_since_touch(airframe, speed_m_s)
        counts.append(
            sum(
                _seen(with_hits(log, times, impulse), times, config, asked_hz)
                for log, times in zip(logs, moments, strict=True)
            )
        )
    recorded_hz = min(shaking(log).rate_hz for log in logs)
    return Sight(airframe.name, asked_hz or recorded_hz, sum(map(len, moments)), tuple(counts))


def impulse_since_touch(airframe: Airframe, speed_m_s: float) -> Floats:
    """What a sensor of the airframe's range shows of the hit until each STEP_S after the first touch, m/s.

    Eq. 2's force over the mass, summed; beyond the range it clips, as a rigid frame's does from slow speeds on.
    """
    arms = airframe.arms
    # Two guards share a head-on hit, each with its arm: together they are eq. 2 for the whole vehicle.
    stop_per_s2, stop_per_s = spring_and_damper(arms.stop, mass_kg=1.0)
    most = airframe.imu.accelerometer_range_m_s2
    depth_m, speed, shown = 0.0, speed_m_s, [0.0]
    for _ in range(round(LONGEST_CONTACT_S / STEP_S)):
        push = arms.stiffness_per_s2 * depth_m + arms.damping_per_s * speed
        beyond_m = depth_m - arms.fold_max_m
        if beyond_m >= 0.0:
            push += max(0.0, stop_per_s2 * beyond_m + stop_per_s * speed)
        if push <= 0.0:
            break
        speed -= push * STEP_S
        depth_m += speed * STEP_S
        shown.append(shown[-1] + min(push, most) * STEP_S)
    return np.array(shown)


def hit_moments(log: Log) -> Iterator[int]:
    """Times in the air, away from take-off and landing, one each SPACING_US and anywhere among the samples."""
    found = shaking(log)
    in_air = [stage in (Stage.HOVER, Stage.UNDER_WAY) for stage in found.stages]
    due_us = int(found.at_us[0]) + SPACING_US
    count = 0
    for at_us, flies in zip(found.at_us.tolist(), in_air, strict=True):
        if not flies:
            due_us = max(due_us, at_us + SPACING_US)
        elif due_us <= at_us <= int(found.at_us[-1]) - ROOM_US:
            yield at_us + round(SLOWEST_INTERVAL_US * (count * GOLDEN % 1.0))
            count += 1
            due_us = at_us + SPACING_US


def with_hits(log: Log, moments_us: Sequence[int], impulse: Floats) -> Log:
    """The log as its sensor would have shown it with a hit at each of the moments."""
    return replace(log, heard=tuple(_struck(log, moments_us, impulse)))


def _struck(log: Log, moments_us: Sequence[int], impulse: Floats) -> Iterator[Heard]:
    window_us = log.averaging_us or shaking(log).interval_us
    lasts_us = len(impulse) * STEP_S * 1e6 + window_us
    number = -1
    for item in log.heard:
        sample = item.sample
        if not isinstance(sample, ImuSample):
            yield item
            continue
        while number + 1 < len(moments_us) and item.at_us > moments_us[number + 1]:
            number += 1
        since_us = item.at_us - moments_us[number] if number >= 0 else lasts_us
        if since_us >= lasts_us:
            yield item
            continue
        push = (_taken(impulse, since_us) - _taken(impulse, since_us - window_us)) / (window_us * 1e-6)
        side_rad = number * TURN_RAD
        x, y, z = sample.specific_force_frd_m_s2
        force = (x - push * math.cos(side_rad), y - push * math.sin(side_rad), z)
        yield Heard(item.at_us, replace(sample, specific_force_frd_m_s2=force))


def _taken(impulse: Floats, since_us: float) -> float:
    """So long after the first touch; nothing before it, all after the end."""
    return float(impulse[min(max(int(since_us * 1e-6 / STEP_S), 0), len(impulse) - 1)])


def _seen(log: Log, moments_us: Sequence[int], config: CompanionConfig, asked_hz: float | None) -> int:
    found = [finding.at_us for finding in watch_log(log, config, asked_hz).collisions]
    return sum(any(hit < at_us <= hit + FOUND_WITHIN_US for at_us in found) for hit in moments_us)
