"""Commands about the vehicle itself: reboot, checks, failures; and those that PX4 leaves unanswered.

Sources: Commander::handle_command and MavlinkReceiver::handle_message_command_both of PX4; the answers were compared
with those of a running SITL.
"""

import math
from collections.abc import Callable

from sim_vehicle.autopilot.flight_commands import CommandedVehicle
from sim_vehicle.autopilot.messages import Command, Result

DO_SET_ACTUATOR = 187
# NAV_ROI and the kinds of DO_SET_ROI: PX4 takes every region of interest, and without a gimbal looks nowhere.
REGIONS_OF_INTEREST = (80, 195, 196, 197, 201)
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
_GPS = 4
_WELL, _OFF = 0, 1


def _reboot(command: Command, flight: CommandedVehicle) -> Result:
    action = _whole(command.param1)
    if action == 0:
        return Result.ACCEPTED
    # No board that this vehicle stands for can switch itself off or wait in its bootloader.
    if action != 1 or flight.commander.arming.armed:
        return Result.DENIED
    flight.wants_reboot = True
    return Result.ACCEPTED


def _inject_failure(command: Command, flight: CommandedVehicle) -> Result:
    """No fix any more; or well again."""
    unit, kind = _whole(command.param1), _whole(command.param2)
    if unit != _GPS or kind not in (_WELL, _OFF):
        return Result.UNSUPPORTED
    if not flight.parameters["SYS_FAILURE_EN"]:
        return Result.DENIED
    flight.commander.positioning.gps_is_off = kind == _OFF
    return Result.ACCEPTED


def _accept(command: Command, flight: CommandedVehicle) -> Result:
    return Result.ACCEPTED


def _leave_unanswered(command: Command, flight: CommandedVehicle) -> None:
    return None


HANDLERS: dict[int, Callable[[Command, CommandedVehicle], Result | None]] = {
    PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    INJECT_FAILURE: _inject_failure,
    **dict.fromkeys((DO_SET_ACTUATOR, RUN_PREARM_CHECKS, *REGIONS_OF_INTEREST), _accept),
    **dict.fromkeys(UNANSWERED, _leave_unanswered),
}


def _whole(value: float) -> int:
    """A parameter that PX4 casts to int; -1 for NaN."""
    return int(value) if math.isfinite(value) else -1
