"""Commands that steer a flight: where to, how fast, round what, along which mission.

Sources: PX4's Commander::handle_command, navigator_main.cpp and FlightModeManager::handleCommand.
"""

import math
from collections.abc import Callable

from sim_vehicle.autopilot.commander.arming import Reason
from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.flight_tasks.target import Kind, NavigatorTarget
from sim_vehicle.autopilot.messages import Command, Result, Severity
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.geography import Place
from sim_vehicle.quantities import Vector3

NAV_TAKEOFF = 22
DO_ORBIT = 34
DO_CHANGE_SPEED = 178
DO_FLIGHTTERMINATION = 185
DO_REPOSITION = 192
MISSION_START = 300

_SWITCH_MODE = 1
"""MAV_DO_REPOSITION_FLAGS_CHANGE_MODE: else the commander refuses, yet a navigator that holds goes (loiter.cpp)."""


def from_mission(given: StoredItem) -> Command:
    """A mission item's command, as the vehicle sends it to itself."""
    return Command(0, 0, 0, 0, given.command, *given.params)


def _take_off(command: Command, commander: Commander) -> Result:
    commander.navigator.take_off_to(_place(command, commander), _down_m(command, commander))
    return commander.request_mode(Mode.TAKEOFF)


def _reposition(command: Command, commander: Commander) -> Result:
    if commander.arming.armed and not commander.navigator.hold_at(_repositioned(command, commander)):
        commander.texts.say(Severity.CRITICAL, "Reposition is outside geofence")
    if int(_given(command.param2) or 0) != _SWITCH_MODE:
        return Result.UNSUPPORTED
    return commander.request_mode(Mode.LOITER)


def _repositioned(command: Command, commander: Commander) -> NavigatorTarget:
    """Where DO_REPOSITION leads: a place, another height over the same, another heading, or a stop."""
    navigator = commander.navigator
    place, yaw_rad, down_m = _place(command, commander), _given(command.param4), _down_m(command, commander)
    if place is None:
        stays = yaw_rad is not None or down_m is not None
        held_ned_m = navigator.shown_target_ned_m or navigator.view.position_ned_m
        place = held_ned_m if stays else navigator.stop_place_ned_m()
    speed_m_s = _given(command.param1)
    there = place[0], place[1], navigator.view.position_ned_m[2] if down_m is None else down_m
    return NavigatorTarget(Kind.HOLD, there, yaw_rad, speed_m_s if speed_m_s and speed_m_s > 0.0 else None)


def _change_speed(command: Command, commander: Commander) -> Result:
    speed_m_s = _given(command.param2)
    # None goes back to MPC_XY_CRUISE.
    commander.navigator.flight.cruise_m_s = speed_m_s if speed_m_s and speed_m_s > 0.0 else None
    return Result.ACCEPTED


def _orbit(command: Command, commander: Commander) -> Result:
    result = commander.request_mode(Mode.ORBIT, tells=False)
    if result is not Result.ACCEPTED:
        commander.texts.say(Severity.CRITICAL, "Orbit command rejected")
        return result
    north, east, _ = _place(command, commander) or (None, None, None)
    centre_ned_m = north, east, _down_m(command, commander)
    navigator, radius_m, speed_m_s = commander.navigator, _given(command.param1), _given(command.param2)
    done = navigator.orbit.change(navigator.view, radius_m, speed_m_s, centre_ned_m)
    if not done:
        commander.texts.say(Severity.CRITICAL, "Orbit radius limit exceeded")
    return result


def _start_mission(command: Command, commander: Commander) -> Result:
    missions, first = commander.navigator.missions, _given(command.param1)
    if not missions.progress.valid:
        commander.texts.say(Severity.CRITICAL, "Mission start denied! No valid mission")
        return Result.DENIED
    if first is None or not -1 <= first < len(missions.mission):
        return Result.DENIED
    if first >= 0:
        missions.choose(int(first))
    result = commander.request_mode(Mode.MISSION)
    return commander.arm(Reason.MISSION) if result is Result.ACCEPTED else result


def _terminate(command: Command, commander: Commander) -> Result:
    if not command.param1 > 0.5 or not commander.arming.armed:
        return Result.DENIED
    return commander.request_mode(Mode.TERMINATION)


def _place(command: Command, commander: Commander) -> Vector3 | None:
    latitude_deg, longitude_deg, origin = _given(command.param5), _given(command.param6), commander.navigator.origin
    if latitude_deg is None or longitude_deg is None:
        return None
    return origin.position_of(Place(latitude_deg, longitude_deg, origin.place.altitude_m))


def _down_m(command: Command, commander: Commander) -> float | None:
    altitude_m = _given(command.param7)
    return None if altitude_m is None else commander.navigator.origin.place.altitude_m - altitude_m


def _given(value: float) -> float | None:
    return value if math.isfinite(value) else None


HANDLERS: dict[int, Callable[[Command, Commander], Result | None]] = {
    NAV_TAKEOFF: _take_off,
    DO_ORBIT: _orbit,
    DO_CHANGE_SPEED: _change_speed,
    DO_FLIGHTTERMINATION: _terminate,
    DO_REPOSITION: _reposition,
    MISSION_START: _start_mission,
}
