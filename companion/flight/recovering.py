"""State recovering: from the hit to rest at the recovery setpoint."""

import math

from companion.estimate.impact import ImpactEstimate
from companion.estimate.settling import SettlingMonitor
from companion.flight.after_hit import afterwards
from companion.flight.collision import CollisionRecord, horizontal_unit
from companion.flight.context import FlightContext, Inputs, Move, Target, as_text
from companion.recovery.envelope import Envelope, away_from_both
from companion.recovery.interface import Contact
from companion.recovery.registry import RECOVERY_LAWS


class Recover:
    """Fly to the newest collision's setpoint, which never changes, and wait until the vehicle has settled."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._record = flight.collisions[-1]
        self._started_us = now_us
        if flight.target is not None:
            flight.yaw_rad = flight.target.yaw_rad
        self._target = Target(self._record.setpoint_ned_m, flight.yaw_rad)
        self._monitor = SettlingMonitor(self._record.setpoint_ned_m, flight.mission.companion.settled)

    def target(self, now_us: int) -> Target | None:
        return self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        record = self._record
        for sample in inputs.positions:
            record.follow_recovery(sample)
            since_us = self._monitor.settled_since(sample)
            if since_us is not None:
                record.settled_at_boot_us, record.is_over = since_us, True
                figures = {"settled_after_s": record.settled_after_s(), "overshoot_m": record.overshoot_m}
                flight.tell(now_us, "recovered", _recovered_text(record), **figures)
                return afterwards(flight)
        timeout_s = flight.mission.companion.settled.timeout_s
        if now_us - self._started_us > timeout_s * 1e6:
            record.is_over = True
            text = f"not settled within {timeout_s:g} s of the hit; the mission goes on"
            flight.tell(now_us, "recovered", text, settled_after_s=None)
            return afterwards(flight)
        return None


def record_collision(flight: FlightContext, estimate: ImpactEstimate, now_us: int) -> None:
    """A new collision: what was known just before it, and from that the setpoint, set once."""
    mission, impact = flight.mission, estimate.impact
    normal = horizontal_unit(estimate.normal_ned)
    contact = Contact(estimate.time_boot_us, estimate.position_ned_m, estimate.velocity_ned_m_s, normal)
    law = RECOVERY_LAWS[mission.recovery.law](mission.recovery)
    assert flight.origin_ned_m is not None, "hits are detected only in flight"
    fence = Envelope(flight.origin_ned_m, mission.fence)
    wanted = law.setpoint_ned_m(contact)
    if flight.collisions and not flight.collisions[-1].is_over:
        earlier = flight.collisions[-1]
        wanted = away_from_both(wanted, normal, earlier.setpoint_ned_m, earlier.normal_ned)
    setpoint = fence.clamp(contact.position_ned_m, wanted)
    strength = math.hypot(*impact.specific_force_frd_m_s2)
    record = CollisionRecord(
        detected_at_us=now_us,
        sample_time_boot_us=impact.sample_time_boot_us,
        detector=mission.companion.detector,
        contact=contact,
        setpoint_ned_m=setpoint,
        normal_ned=normal,
        peak_specific_force_m_s2=strength,
        contact_ended_boot_us=impact.sample_time_boot_us,
    )
    flight.collisions.append(record)
    _tell_detection(flight, record, now_us)


def _tell_detection(flight: FlightContext, record: CollisionRecord, now_us: int) -> None:
    report = record.report()
    text = (
        f"hit {len(flight.collisions)}: {report.peak_specific_force_m_s2:.1f} m/s^2, v_c "
        f"{as_text(report.impact_velocity_ned_m_s)} ({report.impact_speed_m_s:.2f} m/s) at "
        f"{as_text(flight.mission_ned_m(report.position_ned_m))}; recovery setpoint "
        f"{as_text(flight.mission_ned_m(record.setpoint_ned_m))}"
    )
    flight.tell(
        now_us,
        "detection",
        text,
        detector=report.detector,
        sample_time_boot_us=report.sample_time_boot_us,
        impact_velocity_ned_m_s=report.impact_velocity_ned_m_s,
        impact_speed_m_s=report.impact_speed_m_s,
        normal_ned=report.normal_ned,
        specific_force_m_s2=report.peak_specific_force_m_s2,
        position_ned_m=report.position_ned_m,
        recovery_setpoint_ned_m=report.recovery_setpoint_ned_m,
    )


def _recovered_text(record: CollisionRecord) -> str:
    settled_after_s = record.settled_after_s()
    assert settled_after_s is not None
    return (
        f"recovered: settled {settled_after_s:.2f} s after the hit, overshoot {record.overshoot_m * 100:.1f} cm, "
        f"rebound {record.rebound_speed_m_s():.2f} m/s"
    )
