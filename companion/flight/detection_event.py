"""The timeline's event of a hit."""

from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, as_text


def report_detection(flight: FlightContext, record: CollisionRecord, now_us: int) -> None:
    """Report the hit's force, v_c, position and recovery setpoint."""
    report = record.report()
    text = (
        f"hit {len(flight.collisions)}: {report.peak_specific_force_m_s2:.1f} m/s^2, v_c "
        f"{as_text(report.impact_velocity_ned_m_s)} ({report.impact_speed_m_s:.2f} m/s) at "
        f"{as_text(flight.mission_ned_m(report.position_ned_m))}; recovery setpoint "
        f"{as_text(flight.mission_ned_m(record.setpoint_ned_m))}"
    )
    flight.report(
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
