"""MAVLink commands as PX4's commander does and answers them; what concerns a link alone never gets here.

Source: Commander::handle_command of PX4.
"""

import math
from collections.abc import Callable

from sim_vehicle.autopilot import flight_commands
from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.messages import Command, CommandAck, Result, Severity
from sim_vehicle.autopilot.mode_numbers import AUTO_MAIN_MODE, CUSTOM_FLAG, mode_from_request
from sim_vehicle.autopilot.modes import Mode

NAV_RETURN_TO_LAUNCH = 20
NAV_LAND = 21
DO_SET_MODE = 176
COMPONENT_ARM_DISARM = 400

FORCE = 21196
"""Param 2 of COMPONENT_ARM_DISARM: disarms in the air, too. It arms nothing that could not be armed without it:
Commander::handle_command runs the checks for every command from outside, as a SITL was seen to do."""

DO_SET_ACTUATOR = 187
# NAV_ROI and the kinds of DO_SET_ROI: PX4 takes every region of interest, and without a gimbal looks nowhere.
REGIONS_OF_INTEREST = (80, 195, 196, 197, 201)
PREFLIGHT_REBOOT_SHUTDOWN = 246
RUN_PREARM_CHECKS = 401
INJECT_FAILURE = 420

# Left by the commander to modules that this vehicle does not have: cameras, gimbals, grippers, the logger, tunes.
# On a PX4 without them nobody answers either.
UNANSWERED = (
    *(203, 204, 205, 206, 211, 214, 220, 242, 243, 500, 521, 530, 531, 532, 1000, 1001, 2003, 2510, 2511, 3000),
    *(31_010, 31_011, 31_012, 42_600),
)

# FAILURE_UNIT and FAILURE_TYPE, as far as this vehicle knows them.
_GPS = 4
_WELL, _OFF = 0, 1


def answer(command: Command, result: Result) -> CommandAck:
    """The acknowledgement for whoever sent the command."""
    return CommandAck(command.command, result, command.source_system, command.source_component)


def execute(command: Command, commander: Commander) -> CommandAck | None:
    """The commander's part: does it and answers; None leaves the command unanswered."""
    handler = _HANDLERS.get(command.command)
    result = Result.UNSUPPORTED if handler is None else handler(command, commander)
    return None if result is None else answer(command, result)


def _set_mode(command: Command, commander: Commander) -> Result:
    base, main, sub = _byte(command.param1), _byte(command.param2), _byte(command.param3)
    mode = mode_from_request(base, main, sub)
    if mode is not None:
        # MAV_COMP_ID_MISSIONPLANNER: a ground station is told, others are not.
        return commander.request_mode(mode, tells=command.source_component == 190)
    kind = "base" if not base & CUSTOM_FLAG else "auto" if main == AUTO_MAIN_MODE else "main"
    commander.texts.say(Severity.CRITICAL, f"Unsupported {kind} mode")
    return Result.TEMPORARILY_REJECTED


def _arm_disarm(command: Command, commander: Commander) -> Result | None:
    action, forced = whole(command.param1), whole(command.param2) == FORCE
    if action not in (0, 1):
        commander.texts.say(Severity.CRITICAL, f"Unsupported ARM_DISARM param: {command.param1:.3f}")
        return None
    return commander.arm() if action == 1 else commander.disarm(forced)


def _reboot(command: Command, commander: Commander) -> Result:
    """Whoever asks for nothing has it; a SITL neither reboots nor shuts down."""
    return Result.ACCEPTED if _cast(command.param1) == 0 else Result.DENIED


def _inject_failure(command: Command, commander: Commander) -> Result:
    """No fix any more; or well again."""
    unit, kind = _cast(command.param1), _cast(command.param2)
    if unit != _GPS or kind not in (_WELL, _OFF):
        return Result.UNSUPPORTED
    if not commander.parameters["SYS_FAILURE_EN"]:
        return Result.DENIED
    commander.positioning.gps_is_off = kind == _OFF
    return Result.ACCEPTED


_HANDLERS: dict[int, Callable[[Command, Commander], Result | None]] = {
    **flight_commands.HANDLERS,
    DO_SET_MODE: _set_mode,
    COMPONENT_ARM_DISARM: _arm_disarm,
    NAV_LAND: lambda _, commander: commander.request_mode(Mode.LAND, says_so="Landing at current position"),
    NAV_RETURN_TO_LAUNCH: lambda _, commander: commander.request_mode(Mode.RETURN, says_so="Returning to launch"),
    PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    INJECT_FAILURE: _inject_failure,
    **dict.fromkeys((DO_SET_ACTUATOR, RUN_PREARM_CHECKS, *REGIONS_OF_INTEREST), lambda *_: Result.ACCEPTED),
    **dict.fromkeys(UNANSWERED, lambda *_: None),
}


def whole(value: float, unset: int = -1) -> int:
    """The nearest whole number; ``unset`` for NaN and infinity."""
    return math.floor(value + 0.5) if math.isfinite(value) else unset


def _cast(value: float) -> int:
    """A parameter that PX4 casts to int; -1 for NaN."""
    return int(value) if math.isfinite(value) else -1


def _byte(value: float) -> int:
    """A parameter that PX4 casts to uint8."""
    return int(value) & 0xFF if math.isfinite(value) else 0
