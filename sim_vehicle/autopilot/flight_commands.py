"""Commands that steer a flight: where to, how fast, round what, along which mission.

Sources: PX4's Commander::handle_command, navigator_main.cpp and FlightModeManager::handleCommand.
"""

import math
from collections.abc import Callable
from typing import Protocol

from sim_vehicle.autopilot.commander.arming import Reason
from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.flight_tasks.target import Kind, NavigatorTarget
from sim_vehicle.autopilot.messages import Command, Result, Severity, Texts
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.geography import Origin, Place
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

NAV_TAKEOFF = 22
DO_ORBIT = 34
DO_CHANGE_SPEED = 178
DO_FLIGHTTERMINATION = 185
DO_REPOSITION = 192
MISSION_START = 300

_SWITCH_MODE = 1
"""MAV_DO_REPOSITION_FLAGS_CHANGE_MODE: without it, or with any other flag, PX4 does not do it."""


class CommandedVehicle(Protocol):
    """What commands need of the autopilot."""

    commander: Commander
    navigator: Navigator
    origin: Origin
    missions: MissionStore
    parameters: Parameters
    texts: Texts

    def request_mode(self, mode: Mode, says_so: str | None = None) -> Result:
        """Change the mode; ``says_so`` is the text for a change that was accepted."""


def from_mission(given: StoredItem) -> Command:
    """A mission item's command, as the vehicle sends it to itself."""
    p1, p2, p3, p4, p5, p6, p7 = given.params
    return Command(0, 0, 0, 0, given.command, p1, p2, p3, p4, p5, p6, p7)


def _take_off(command: Command, flight: CommandedVehicle) -> Result:
    altitude_m = _given(command.param7)
    down_m = None if altitude_m is None else flight.origin.place.altitude_m - altitude_m
    flight.navigator.take_off_to(_place(command, flight), down_m)
    return flight.request_mode(Mode.TAKEOFF)


def _reposition(command: Command, flight: CommandedVehicle) -> Result:
    if int(_given(command.param2) or 0) != _SWITCH_MODE:
        return Result.UNSUPPORTED
    if flight.commander.arming.armed and not flight.navigator.hold_at(_repositioned(command, flight)):
        flight.texts.say(Severity.CRITICAL, "Reposition is outside geofence")
    return flight.request_mode(Mode.LOITER)


def _repositioned(command: Command, flight: CommandedVehicle) -> NavigatorTarget:
    """Where DO_REPOSITION leads: a place, another height over the same, another heading, or a stop."""
    navigator = flight.navigator
    place, yaw_rad, altitude_m = _place(command, flight), _given(command.param4), _given(command.param7)
    down_m = navigator.view.position_ned_m[2] if altitude_m is None else flight.origin.place.altitude_m - altitude_m
    if place is None:
        stays = yaw_rad is not None or altitude_m is not None
        place = navigator.held_place_ned_m if stays else navigator.stop_place_ned_m()
    speed_m_s = _given(command.param1)
    return NavigatorTarget(
        Kind.HOLD, (place[0], place[1], down_m), yaw_rad, speed_m_s if speed_m_s and speed_m_s > 0.0 else None
    )


def _change_speed(command: Command, flight: CommandedVehicle) -> Result:
    speed_m_s = _given(command.param2)
    flight.navigator.change_speed(speed_m_s if speed_m_s and speed_m_s > 0.0 else None)
    return Result.ACCEPTED


def _orbit(command: Command, flight: CommandedVehicle) -> Result:
    result = flight.request_mode(Mode.ORBIT)
    if result is not Result.ACCEPTED:
        flight.texts.say(Severity.CRITICAL, "Orbit command rejected")
        return result
    place, altitude_m = _place(command, flight), _given(command.param7)
    north, east = (None, None) if place is None else place[:2]
    down_m = None if altitude_m is None else flight.origin.place.altitude_m - altitude_m
    done = flight.navigator.change_orbit(_given(command.param1), _given(command.param2), (north, east, down_m))
    if not done:
        flight.texts.say(Severity.CRITICAL, "Orbit radius limit exceeded")
    return result


def _start_mission(command: Command, flight: CommandedVehicle) -> Result:
    missions, first = flight.missions, _given(command.param1)
    if not missions.progress.valid:
        flight.texts.say(Severity.CRITICAL, "Mission start denied! No valid mission")
        return Result.DENIED
    if first is None or not -1 <= first < len(missions.mission):
        return Result.DENIED
    if first >= 0:
        missions.choose(int(first))
    result = flight.request_mode(Mode.MISSION)
    return flight.commander.arm(Reason.MISSION) if result is Result.ACCEPTED else result


def _terminate(command: Command, flight: CommandedVehicle) -> Result:
    if not command.param1 > 0.5 or not flight.commander.arming.armed:
        return Result.DENIED
    return flight.request_mode(Mode.TERMINATION)


def _place(command: Command, flight: CommandedVehicle) -> Vector3 | None:
    latitude_deg, longitude_deg = _given(command.param5), _given(command.param6)
    if latitude_deg is None or longitude_deg is None:
        return None
    return flight.origin.position_of(Place(latitude_deg, longitude_deg, flight.origin.place.altitude_m))


def _given(value: float) -> float | None:
    return value if math.isfinite(value) else None


HANDLERS: dict[int, Callable[[Command, CommandedVehicle], Result | None]] = {
    NAV_TAKEOFF: _take_off,
    DO_ORBIT: _orbit,
    DO_CHANGE_SPEED: _change_speed,
    DO_FLIGHTTERMINATION: _terminate,
    DO_REPOSITION: _reposition,
    MISSION_START: _start_mission,
}
