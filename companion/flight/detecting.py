"""Runs the collision monitor in a flight: reports its notices, returns its collisions."""

import math
from collections.abc import Sequence

from companion.flight.context import FlightContext
from companion.messages import AttitudeTarget, ImuSample, LocalPosition, Sample
from companion.motion.config import KEPT_US, LONGEST_GAP_US
from companion.motion.rotation import tilt_rad
from companion.motion.strapdown import Strapdown
from companion.reflex import monitor
from companion.reflex.detector import ImpactKind, Phase, Situation
from companion.reflex.impact import ImpactEstimate
from companion.reflex.monitor import CollisionMonitor


def collisions(
    flight: FlightContext,
    collision_monitor: CollisionMonitor,
    samples: Sequence[Sample],
    situation: Situation,
    now_us: int,
) -> list[ImpactEstimate]:
    """The impacts of this step that are collisions."""
    result = monitor.advance(collision_monitor, samples, situation, now_us)
    if (collision_monitor.no_data_reason is None) is not (flight.no_data_since_us is None):
        flight.no_data_since_us = None if collision_monitor.no_data_reason is None else now_us
    for notice in result.notices:
        flight.report(now_us, notice.kind, notice.text, **notice.data)
    for estimate in result.impacts:
        # A wreck bounces and is picked up: that is one crash, and reported.
        if not flight.is_wreck:
            _report_contact(flight, estimate, collision_monitor.estimator.strapdown, now_us)
        if estimate.impact.is_ground:
            flight.note_touchdown()
    # A crash is told where no hit is looked for, too.
    is_watched = situation.off_reason is None
    found = [estimate for estimate in result.impacts if estimate.impact.is_collision and is_watched]
    _learn_thrust(flight, samples, collision_monitor.state.phase)
    strapdown = collision_monitor.estimator.strapdown
    held = None if found else _sustained_force(flight, samples, situation, strapdown, now_us)
    return found if held is None else [held]


def _report_contact(flight: FlightContext, estimate: ImpactEstimate, strapdown: Strapdown, now_us: int) -> None:
    """What is no collision, and a crash; a collision is reported with its recovery."""
    kind, force_m_s2, down_m_s = estimate.impact.kind, estimate.peak_specific_force_m_s2, estimate.velocity_ned_m_s[2]
    if not estimate.impact.is_collision:
        text = f"{kind.value}: {force_m_s2:.1f} m/s^2, no collision"
        flight.report(now_us, "contact", text, touched=kind.value, specific_force_m_s2=force_m_s2)
    elif kind is ImpactKind.CRASH:
        tilt_deg = math.degrees(tilt_rad(strapdown.valid_wxyz))
        text = f"crash: {force_m_s2:.0f} m/s^2, sinking at {down_m_s:.1f} m/s, tilted by {tilt_deg:.0f} degrees"
        flight.report(now_us, "crash", text, specific_force_m_s2=force_m_s2, down_m_s=down_m_s, tilt_deg=tilt_deg)


def _learn_thrust(flight: FlightContext, samples: Sequence[Sample], phase: Phase) -> None:
    """What thrust there is, from all flight in free air; before the detector is armed, too."""
    for sample in samples:
        if isinstance(sample, AttitudeTarget):
            flight.thrust.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        elif isinstance(sample, ImuSample):
            elapsed_s, flight.thrust_boot_us = 1e-6 * (sample.time_boot_us - flight.thrust_boot_us), sample.time_boot_us
            if flight.has_climbed and phase is not Phase.CONTACT and elapsed_s < 1e-6 * LONGEST_GAP_US:
                flight.thrust.learn(sample.time_boot_us, -sample.specific_force_frd_m_s2[2], elapsed_s)


def _sustained_force(
    flight: FlightContext, samples: Sequence[Sample], situation: Situation, strapdown: Strapdown, now_us: int
) -> ImpactEstimate | None:
    """A sustained external force that no detector shows: only while the vehicle flies to a position."""
    target, force = flight.target, flight.sustained_force
    flown_to = situation.setpoint_position_ned_m
    if not flight.has_position:
        force.forget()  # half a second without a position is no tilt that lasted half a second
    is_off = situation.off_reason is not None or situation.descent_commanded or not flight.has_position
    if is_off or target is None or target.lean is not None:
        flown_to = None
    for sample in samples:
        if type(sample) is ImuSample:
            force.add_imu(sample.specific_force_frd_m_s2)
        elif type(sample) is AttitudeTarget:
            force.gain.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        elif isinstance(sample, LocalPosition) and flight.vehicle.attitude is not None:
            late_us = force.time_us - sample.time_boot_us
            if late_us >= KEPT_US:
                force.forget()
            elif late_us >= 0:
                continue
            held = force.step(sample, strapdown.valid_wxyz, flown_to)
            if held is not None:
                _report_sustained_force(flight, held, now_us)
                return held
    return None


def _report_sustained_force(flight: FlightContext, held: ImpactEstimate, now_us: int) -> None:
    normal, force_m_s2, lasted_s = held.normal.direction_ned, held.peak_specific_force_m_s2, held.time_error_us * 1e-6
    side = "horizontal" if normal[2] == 0.0 else "downward" if normal[2] > 0.0 else "upward"
    text = f"something is in the way: {side} external force of {force_m_s2:.1f} m/s^2 for {lasted_s:.1f} s"
    flight.report(now_us, "in_the_way", text, normal_ned=normal, push_m_s2=force_m_s2, lasted_s=lasted_s)
