"""Commands about the vehicle itself: home, storage, reboot, checks, failures; and those that PX4 leaves unanswered.

Sources: Commander::handle_command and MavlinkReceiver::handle_message_command_both of PX4; the answers were compared
with those of a running SITL.
"""

import math
from collections.abc import Callable
from typing import Protocol

from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.messages import Command, Result
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place
from sim_vehicle.parameters.store import Parameters

DO_SET_HOME = 179
DO_SET_ACTUATOR = 187
PREFLIGHT_STORAGE = 245
PREFLIGHT_REBOOT_SHUTDOWN = 246
RUN_PREARM_CHECKS = 401
INJECT_FAILURE = 420
LOGGING_START, LOGGING_STOP = 2510, 2511

# Left by the commander to modules that this vehicle does not have: cameras, gimbals, grippers, the logger, tunes.
# On a PX4 without them nobody answers either.
UNANSWERED = frozenset(
    {203, 204, 205, 206, 214, 242, 243, 500, 530, 531, 532, 1000, 1001, 2003, 3000, 31_010, 31_011, 31_012}
    | {LOGGING_START, LOGGING_STOP}
)


# FAILURE_UNIT and FAILURE_TYPE, as far as this vehicle knows them.
_GPS, _BATTERY = 4, 100
_WELL, _OFF = 0, 1


class Ground:
    """Refuses what a PX4 refuses while it is armed."""

    def __init__(self, parameters: Parameters, origin: Origin, commander: Commander, navigator: Navigator) -> None:
        self._parameters = parameters
        self._origin = origin
        self._arming, self._battery = commander.arming, commander.battery
        self._positioning = commander.positioning
        self._navigator = navigator
        self.wants_reboot = False
        """To be done by whoever switches the software on and off, once the answer is out."""

    def set_home(self, place: Place | None, yaw_rad: float) -> Result:
        """DO_SET_HOME: to a place, or to where the vehicle is; a heading that is not a number is north."""
        if not self._parameters["COM_HOME_EN"]:
            return Result.DENIED
        if place is None:
            self._navigator.set_home_here()
        else:
            self._navigator.set_home(self._origin.position_of(place), 0.0 if math.isnan(yaw_rad) else yaw_rad)
        return Result.ACCEPTED

    def save_parameters(self) -> Result:
        """PREFLIGHT_STORAGE: nothing is to be done, for they are always kept."""
        return Result.TEMPORARILY_REJECTED if self._arming.armed else Result.ACCEPTED

    def reset_parameters(self) -> Result:
        """PREFLIGHT_STORAGE: back to the defaults."""
        if self._arming.armed:
            return Result.TEMPORARILY_REJECTED
        self._parameters.reset()
        return Result.ACCEPTED

    def reboot(self) -> Result:
        """PREFLIGHT_REBOOT_SHUTDOWN."""
        if self._arming.armed:
            return Result.DENIED
        self.wants_reboot = True
        return Result.ACCEPTED

    def lose_gps(self, is_off: bool) -> Result:
        """INJECT_FAILURE: no fix any more, or again one."""
        if not self._parameters["SYS_FAILURE_EN"]:
            return Result.DENIED
        self._positioning.gps_is_off = is_off
        return Result.ACCEPTED

    def empty_battery(self, is_off: bool) -> Result:
        """INJECT_FAILURE: the charge is gone, or there again."""
        if not self._parameters["SYS_FAILURE_EN"]:
            return Result.DENIED
        self._battery.is_forced_empty = is_off
        return Result.ACCEPTED


class OnGround(Protocol):
    """Whoever has a `Ground`."""

    ground: Ground


def _set_home(command: Command, flight: OnGround) -> Result:
    if command.param1 > 0.5:
        return flight.ground.set_home(None, math.nan)
    place = (command.param5, command.param6, command.param7)
    if not all(math.isfinite(value) for value in place):
        return Result.DENIED
    yaw_rad = math.radians(command.param4) if math.isfinite(command.param4) else math.nan
    return flight.ground.set_home(Place(*place), yaw_rad)


def _storage(command: Command, flight: OnGround) -> Result | None:
    action = _whole(command.param1)
    if action in (0, 1):
        return flight.ground.save_parameters()
    return flight.ground.reset_parameters() if action in (2, 3, 4) else None


def _reboot(command: Command, flight: OnGround) -> Result:
    action = _whole(command.param1)
    if action == 0:
        return Result.ACCEPTED
    # No board that this vehicle stands for can switch itself off or wait in its bootloader.
    return flight.ground.reboot() if action == 1 else Result.DENIED


def _inject_failure(command: Command, flight: OnGround) -> Result:
    unit, kind = _whole(command.param1), _whole(command.param2)
    fail = {_GPS: flight.ground.lose_gps, _BATTERY: flight.ground.empty_battery}.get(unit)
    if fail is None or kind not in (_WELL, _OFF):
        return Result.UNSUPPORTED
    return fail(kind == _OFF)


def _accept(command: Command, flight: OnGround) -> Result:
    return Result.ACCEPTED


def _leave_unanswered(command: Command, flight: OnGround) -> None:
    return None


HANDLERS: dict[int, Callable[[Command, OnGround], Result | None]] = {
    DO_SET_HOME: _set_home,
    DO_SET_ACTUATOR: _accept,
    PREFLIGHT_STORAGE: _storage,
    PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    RUN_PREARM_CHECKS: _accept,
    INJECT_FAILURE: _inject_failure,
    **dict.fromkeys(UNANSWERED, _leave_unanswered),
}


def _whole(value: float) -> int:
    """A parameter that PX4 casts to int; -1 for NaN."""
    return int(value) if math.isfinite(value) else -1
