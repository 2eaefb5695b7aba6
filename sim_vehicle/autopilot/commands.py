"""MAVLink commands and their acknowledgements, in PX4's two layers.

The receiver answers what concerns the link and, for DO_SET_MODE, answers ACCEPTED before anyone has
looked at it; the commander does the rest and answers once more with the true result. Sources:
MavlinkReceiver::handle_message_command_both and Commander::handle_command of PX4.
"""

import math
from collections.abc import Callable
from typing import Protocol

from sim_vehicle.autopilot import flight_commands
from sim_vehicle.autopilot.flight_commands import CommandedVehicle
from sim_vehicle.autopilot.messages import EVERY_ID, Command, CommandAck, Identity, Result, Severity
from sim_vehicle.autopilot.mode_numbers import AUTO_MAIN_MODE, CUSTOM_FLAG, mode_from_request
from sim_vehicle.autopilot.modes import Mode

NAV_RETURN_TO_LAUNCH = 20
NAV_LAND = 21
DO_SET_MODE = 176
COMPONENT_ARM_DISARM = 400
SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512
REQUEST_AUTOPILOT_CAPABILITIES = 520
"""Answered whichever component it is for."""

FORCE = 21196
"""Param 2 of COMPONENT_ARM_DISARM: disarms in the air, too. It arms nothing that could not be armed without it:
Commander::handle_command runs the checks for every command from outside, as a SITL was seen to do."""
# The commands from before REQUEST_MESSAGE, each for one message: AUTOPILOT_VERSION, HOME_POSITION, FLIGHT_INFORMATION,
# STORAGE_INFORMATION.
REQUESTS = {REQUEST_AUTOPILOT_CAPABILITIES: 148, 410: 242, 528: 264, 525: 261}

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

NO_ID = -1
"""No message has it: stands for a parameter that is not a number."""


class StreamControl(Protocol):
    """What commands may do to the streams of the link."""

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Ask for an interval: negative stops, 0 restores the default; False where it cannot be."""

    def send_now(self, message_id: int) -> bool:
        """Send one message at once; False for an unknown one and for one that has nothing new."""


def is_for_us(command: Command, us: Identity) -> bool:
    """Whether PX4 takes the command: others are not answered, nor are its own echoes."""
    if (command.source_system, command.source_component) == us:
        return False
    if command.command == REQUEST_AUTOPILOT_CAPABILITIES:
        return command.target_system in (us.system, EVERY_ID)
    return us.is_addressed(command.target_system, command.target_component)


def receive(command: Command, streams: StreamControl) -> tuple[Result | None, bool]:
    """The receiver's part: its answer, if it has one, and whether the commander gets the command."""
    if command.command == SET_MESSAGE_INTERVAL:
        return _set_interval(command, streams), False
    if command.command == REQUEST_MESSAGE:
        return _sent(streams.send_now(_whole(command.param1))), False
    if command.command in REQUESTS:
        return _sent(streams.send_now(REQUESTS[command.command])), False
    if command.command == DO_SET_MODE:
        return Result.ACCEPTED, True
    return None, True


def answer(command: Command, result: Result) -> CommandAck:
    """The acknowledgement for whoever sent the command."""
    return CommandAck(command.command, result, command.source_system, command.source_component)


def execute(command: Command, flight: CommandedVehicle) -> Result | None:
    """The commander's part: does it and returns its answer; None leaves the command unanswered."""
    handler = _HANDLERS.get(command.command)
    return Result.UNSUPPORTED if handler is None else handler(command, flight)


def _set_interval(command: Command, streams: StreamControl) -> Result:
    # Response target and the two reserved parameters: PX4 supports none of them.
    if any(_whole(value, unset=0) != 0 for value in (command.param3, command.param4, command.param7)):
        return Result.FAILED
    if not math.isfinite(command.param2):
        return Result.FAILED
    done = streams.set_interval(_whole(command.param1), command.param2)
    return Result.ACCEPTED if done else Result.FAILED


def _sent(was_sent: bool) -> Result:
    return Result.ACCEPTED if was_sent else Result.DENIED


def _set_mode(command: Command, flight: CommandedVehicle) -> Result:
    base, main, sub = _byte(command.param1), _byte(command.param2), _byte(command.param3)
    mode = mode_from_request(base, main, sub)
    if mode is not None:
        return flight.request_mode(mode)
    kind = "base" if not base & CUSTOM_FLAG else "auto" if main == AUTO_MAIN_MODE else "main"
    flight.texts.say(Severity.CRITICAL, f"Unsupported {kind} mode")
    return Result.TEMPORARILY_REJECTED


def _arm_disarm(command: Command, flight: CommandedVehicle) -> Result | None:
    action, forced = _whole(command.param1), _whole(command.param2) == FORCE
    if action not in (0, 1):
        flight.texts.say(Severity.CRITICAL, f"Unsupported ARM_DISARM param: {command.param1:.3f}")
        return None
    return flight.commander.arm() if action == 1 else flight.commander.disarm(forced)


def _land(command: Command, flight: CommandedVehicle) -> Result:
    return flight.request_mode(Mode.LAND, says_so="Landing at current position")


def _return(command: Command, flight: CommandedVehicle) -> Result:
    return flight.request_mode(Mode.RETURN, says_so="Returning to launch")


def _reboot(command: Command, flight: CommandedVehicle) -> Result:
    """Whoever asks for nothing has it; a SITL neither reboots nor shuts down."""
    return Result.ACCEPTED if _cast(command.param1) == 0 else Result.DENIED


def _inject_failure(command: Command, flight: CommandedVehicle) -> Result:
    """No fix any more; or well again."""
    unit, kind = _cast(command.param1), _cast(command.param2)
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


_HANDLERS: dict[int, Callable[[Command, CommandedVehicle], Result | None]] = {
    **flight_commands.HANDLERS,
    DO_SET_MODE: _set_mode,
    COMPONENT_ARM_DISARM: _arm_disarm,
    NAV_LAND: _land,
    NAV_RETURN_TO_LAUNCH: _return,
    PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    INJECT_FAILURE: _inject_failure,
    **dict.fromkeys((DO_SET_ACTUATOR, RUN_PREARM_CHECKS, *REGIONS_OF_INTEREST), _accept),
    **dict.fromkeys(UNANSWERED, _leave_unanswered),
}


def _whole(value: float, unset: int = NO_ID) -> int:
    """The nearest whole number; ``unset`` for NaN and infinity."""
    return math.floor(value + 0.5) if math.isfinite(value) else unset


def _cast(value: float) -> int:
    """A parameter that PX4 casts to int; -1 for NaN."""
    return int(value) if math.isfinite(value) else -1


def _byte(value: float) -> int:
    """A parameter that PX4 casts to uint8."""
    return int(value) & 0xFF if math.isfinite(value) else 0
