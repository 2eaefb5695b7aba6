"""Companion and simulated vehicle in lockstep, joined by the same bytes, on virtual time."""

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from companion.companion import Companion
from companion.mission.item_trajectory import LEAST_TRY_M_S
from companion.mission.model import Mission, itinerary
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import look_for_file
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.summary import Flown
from rebound_cli.results.truth_match import FlightTruth
from sim_vehicle.truth import clock_jumps

if TYPE_CHECKING:
    from sim_vehicle.shell.json_udp import ArduPilotVehicle
    from sim_vehicle.vehicle import SimulatedVehicle

# When virtual time begins: any fixed moment will do, so that the same seed gives the same bytes.
EPOCH_US = 1_600_000_000_000_000

# What a mission may take beyond its own distances and durations: connecting, arming, landing.
_LIMIT_MARGIN_S = 60.0
# Times the planned duration: recoveries, and ways round what was hit, take longer.
_LIMIT_FACTOR = 3.0
# A wait without a time-out; in lockstep nobody comes to end it.
_LONGEST_WAIT_S = 60.0

# Ctrl-C and the live line are looked at once in so many intervals: often enough at 100 times real time.
_LOOK_EVERY = 250


def virtual_time_limit_s(mission: Mission) -> float:
    """Longest virtual time a mission may reasonably take; a flight beyond it hangs."""
    recovers_s = mission.on_collision.hold_s + mission.companion.settled.timeout_s
    limit_s, again_s = _LIMIT_MARGIN_S + mission.on_collision.max_hits * recovers_s, 0.0
    for leg in itinerary(mission):
        limit_s += _LIMIT_FACTOR * (_LONGEST_WAIT_S if leg.lasts_s is None else leg.lasts_s)
        policy = leg.step.item.on_collision or mission.on_collision
        if policy.then == "retry" and leg.trajectory is not None:
            # The longest of these, after each hit, and always as slowly as it is ever tried again.
            slowest_s = max(leg.lasts_s or 0.0, leg.trajectory.distance_m / LEAST_TRY_M_S)
            again_s = max(again_s, policy.max_hits * slowest_s)
    return limit_s + again_s


def fly_mission_lockstep(
    mission: Mission,
    vehicle: "SimulatedVehicle | ArduPilotVehicle",
    recorder: FlightRecorder,
    interrupts: Interrupts,
    console: Console | None = None,
) -> Flown:
    """Exchange bytes, an interval a step, until the companion has finished, its packets one interval later; it fails
    when that takes much longer than it should.
    """
    companion = Companion(mission)
    limit_s, started_s = virtual_time_limit_s(mission), time.monotonic()
    limit_us = vehicle.time_boot_us + round(limit_s * 1e6)
    is_confirmed, pending, count = False, b"", 0
    while not companion.finished:
        frames = vehicle.step(pending)
        now_us = EPOCH_US + vehicle.time_boot_us
        result = companion.step(b"".join(frames), now_us)
        pending = b"".join(result.sent_frames)
        recorder.record(now_us, result)
        if result.events:
            recorder.record_obstacles(companion.obstacles())
        if not is_confirmed and companion.plan_is_ready():
            is_confirmed = True
            companion.confirm_plan()
            recorder.record_input(now_us, "confirm")
        count += 1
        if count % _LOOK_EVERY:
            continue
        if vehicle.time_boot_us > limit_us:
            break
        if (reason := interrupts.news(companion.stop_is_put_off)) is not None:
            companion.stop(reason)
            recorder.record_input(now_us, "stop", reason=reason)
        look_for_file(companion, recorder, now_us)
        # In a file or a pipe the timeline that follows within seconds says the same.
        if console is not None and console.is_terminal:
            console.live(companion.status, vehicle.time_boot_us / 1e6)
    wall_clock_s, report, truth = time.monotonic() - started_s, companion.report(), vehicle.truth
    if not companion.finished:
        reason = f"the flight was not over after {limit_s:.0f} s of virtual time"
        report = replace(report, outcome="failed", reason=reason)
    jumps = clock_jumps(truth.faults)
    return Flown(report, wall_clock_s, FlightTruth(truth.hits_so_far(), truth.series(), EPOCH_US, jumps=jumps))
