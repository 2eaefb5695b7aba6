"""What each failsafe does: one row a trigger, with the parameter that decides and what its values mean.

Source: PX4's commander/failsafe/failsafe.cpp (August 2025, between v1.16 and v1.17) and commander_params.yaml.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import NamedTuple

from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.parameters.store import Parameters


class Action(IntEnum):
    """What a failsafe may do. The order is the precedence: of several the greatest is taken."""

    NONE = 0
    WARN = 1
    FALL_BACK_TO_POSITION = 2
    FALL_BACK_TO_ALTITUDE = 3
    FALL_BACK_TO_STABILIZED = 4
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8


class Clears(StrEnum):
    """When an action ends after its trigger is gone."""

    AT_ONCE = "with the trigger"
    MODE_CHANGE_OR_DISARM = "then mode change or disarm"


class Takeover(IntEnum):
    """Whether the pilot may end the action; of several the greatest, the strictest, counts."""

    ALWAYS = 0
    BY_MODE_SWITCH = 1
    AFTER_DELAY = 2
    """Hold for COM_FAIL_ACT_T first, in which a mode switch takes over; then the action."""


class FailsafeTrigger(StrEnum):
    """What sets a failsafe off."""

    STICKS_LOST = "manual control lost"
    GROUND_STATION_LOST = "ground station lost"
    FENCE = "geofence breached"
    MODE_CANNOT_RUN = "mode cannot run"


@dataclass(frozen=True, slots=True)
class Response:
    """One way to react."""

    action: Action
    clears: Clears = Clears.AT_ONCE
    takeover: Takeover = Takeover.AFTER_DELAY


class FailsafeSituation(NamedTuple):
    """What the failsafes judge, as the commander has it in this cycle. A tuple: one is made fifty times a second."""

    armed: bool
    intended: Mode
    mode_requested: bool = False
    """A mode was accepted just now, be it the same."""
    sticks_moved: bool = False
    """The pilot moves his sticks while a failsafe flies."""
    sticks_lost: bool = True
    sticks_lost_at_arming: bool = True
    ground_station_lost: bool = True
    fence_breached: bool = False
    cannot_run: frozenset[Mode] = frozenset()
    """Modes whose needs are not met, sticks left aside."""


@dataclass(frozen=True, slots=True)
class FailsafeRow:
    """A trigger, when it counts, and what follows."""

    trigger: FailsafeTrigger
    counts: Callable[[FailsafeSituation, Parameters], bool]
    parameter: str
    """Its value chooses the response."""
    responses: Mapping[int, Response]
    otherwise: Response = Response(Action.NONE)
    """For values that are not in the table, such as PX4's disarming and terminating."""

    def response(self, parameters: Parameters) -> Response:
        """What these parameters want."""
        return self.responses.get(int(parameters[self.parameter]), self.otherwise)


def _kept(action: Action, takeover: Takeover = Takeover.AFTER_DELAY) -> Response:
    return Response(action, Clears.MODE_CHANGE_OR_DISARM, takeover)


_NOTHING, _WARNING = Response(Action.NONE), Response(Action.WARN)

_LINK_LOSS: dict[int, Response] = {0: _NOTHING, 1: _kept(Action.HOLD), 2: _kept(Action.RETURN), 3: _kept(Action.LAND)}
_FENCE: dict[int, Response] = {
    0: _NOTHING,
    1: _WARNING,
    2: _kept(Action.HOLD, Takeover.BY_MODE_SWITCH),
    3: _kept(Action.RETURN),
    5: _kept(Action.LAND),
}

# COM_RCL_EXCEPT and COM_DLL_EXCEPT: in which modes a lost link is no matter.
_EXCEPT_MISSION, _EXCEPT_HOLD, _EXCEPT_OFFBOARD = 1, 2, 4
_EXCEPTION_OF = {
    Mode.MISSION: _EXCEPT_MISSION,
    Mode.LOITER: _EXCEPT_HOLD,
    Mode.TAKEOFF: _EXCEPT_HOLD,
    Mode.OFFBOARD: _EXCEPT_OFFBOARD,
}
_NO_STICKS = 4
"""COM_RC_IN_MODE: no manual control at all."""


def _excepted(mode: Mode, mask: float) -> bool:
    return bool(_EXCEPTION_OF.get(mode, 0) & int(mask))


def _sticks_lost(now: FailsafeSituation, parameters: Parameters) -> bool:
    wanted = parameters["COM_RC_IN_MODE"] != _NO_STICKS and not now.sticks_lost_at_arming
    return now.sticks_lost and wanted and not _excepted(now.intended, parameters["COM_RCL_EXCEPT"])


def _ground_station_lost(now: FailsafeSituation, parameters: Parameters) -> bool:
    if parameters["NAV_DLL_ACT"] == 0 or now.intended is Mode.LAND or not now.armed:
        return False
    return now.ground_station_lost and not _excepted(now.intended, parameters["COM_DLL_EXCEPT"])


# In PX4's order. The mode that cannot run comes last and is no row: see `Failsafe`.
ROWS: tuple[FailsafeRow, ...] = (
    FailsafeRow(FailsafeTrigger.STICKS_LOST, _sticks_lost, "NAV_RCL_ACT", _LINK_LOSS),
    FailsafeRow(FailsafeTrigger.GROUND_STATION_LOST, _ground_station_lost, "NAV_DLL_ACT", _LINK_LOSS),
    FailsafeRow(FailsafeTrigger.FENCE, lambda now, parameters: now.fence_breached, "GF_ACTION", _FENCE, _WARNING),
)

MODE_OF: dict[Action, Mode] = {
    Action.FALL_BACK_TO_POSITION: Mode.POSCTL,
    Action.FALL_BACK_TO_ALTITUDE: Mode.ALTCTL,
    Action.FALL_BACK_TO_STABILIZED: Mode.STABILIZED,
    Action.HOLD: Mode.LOITER,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.DESCEND: Mode.DESCEND,
}

OFFBOARD_LOSS: dict[int, Action] = {
    0: Action.FALL_BACK_TO_POSITION,
    1: Action.FALL_BACK_TO_ALTITUDE,
    2: Action.FALL_BACK_TO_STABILIZED,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
}
"""COM_OBL_RC_ACT: what is done."""


def responses_now(now: FailsafeSituation, parameters: Parameters) -> list[tuple[FailsafeTrigger, Response]]:
    """The rows that count now, without those that want nothing."""
    found = [(row.trigger, row.response(parameters)) for row in ROWS if row.counts(now, parameters)]
    return [(trigger, response) for trigger, response in found if response.action is not Action.NONE]


def mode_fallback(now: FailsafeSituation, parameters: Parameters, intended: Mode) -> Action:
    """What becomes of a mode that cannot run: offboard's own loss first, then sticks, then the return."""
    action, mode = Action.NONE, intended
    if mode is Mode.OFFBOARD and mode in now.cannot_run:
        action = OFFBOARD_LOSS.get(int(parameters["COM_OBL_RC_ACT"]), OFFBOARD_LOSS[0])
        mode = MODE_OF[action]
    if mode is Mode.POSCTL and mode in now.cannot_run:
        action, mode = Action.FALL_BACK_TO_ALTITUDE, Mode.ALTCTL
    return Action.RETURN if mode in now.cannot_run else action
