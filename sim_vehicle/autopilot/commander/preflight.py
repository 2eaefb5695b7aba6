"""What forbids arming beside what the mode needs, and what PX4 says about it when somebody tries.

Source: PX4's commander/HealthAndArmingChecks (rcAndDataLinkCheck, batteryCheck,
estimatorCheck, geofenceCheck, modeCheck).
"""

from sim_vehicle.autopilot.commander.battery import Battery
from sim_vehicle.autopilot.commander.battery import Warning as BatteryWarning
from sim_vehicle.autopilot.commander.ground_station import GroundStation
from sim_vehicle.autopilot.commander.positioning import Positioning
from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.parameters.store import Parameters

_BATTERY_TEXTS = {
    BatteryWarning.LOW: "Low battery",
    BatteryWarning.CRITICAL: "Critical battery",
    BatteryWarning.EMERGENCY: "Emergency battery level",
}


# COM_ARM_WO_GPS: 0 refuses, 1 warns, 2 does not care.
_NOT_WITHOUT_GPS = 0


def problems(
    parameters: Parameters,
    ground_station: GroundStation,
    battery: Battery,
    navigator: Navigator,
    positioning: Positioning,
) -> list[StatusText]:
    """Empty where the vehicle may be armed, as far as these go."""
    found = []
    if ground_station.lost and parameters["NAV_DLL_ACT"] > 0:
        found.append(StatusText(Severity.WARNING, "Preflight Fail: No connection to the GCS"))
    least = parameters["COM_ARM_BAT_MIN"]
    is_too_low = battery.remaining < least if least >= 0.0 else battery.warning >= BatteryWarning.CRITICAL
    if is_too_low:
        found.append(StatusText(Severity.CRITICAL, _BATTERY_TEXTS.get(battery.warning, "Low battery")))
    if positioning.is_without_gps and parameters["COM_ARM_WO_GPS"] == _NOT_WITHOUT_GPS:
        found.append(StatusText(Severity.CRITICAL, "Preflight Fail: GPS fix too low"))
    if navigator.fence.breached:
        found.append(StatusText(Severity.CRITICAL, navigator.fence.breach_text))
    if parameters["COM_ARM_MIS_REQ"] and not navigator.progress.valid:
        # An event without a text in PX4 too.
        found.append(StatusText(Severity.INFO, ""))
    return found
