"""PX4's flight modes: what each needs and the one table of how they follow each other.

Sources: commander/ModeUtil/mode_requirements.cpp, UserModeIntention.cpp and failsafe/failsafe.cpp of PX4.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from functools import cache


class Mode(IntEnum):
    """The modes of a multicopter by PX4's NAVIGATION_STATE numbers."""

    ALTCTL = 1
    POSCTL = 2
    MISSION = 3
    LOITER = 4
    RETURN = 5
    DESCEND = 12
    TERMINATION = 13
    OFFBOARD = 14
    STABILIZED = 15
    TAKEOFF = 17
    LAND = 18
    FOLLOW_TARGET = 19
    ORBIT = 21


class Need(StrEnum):
    """What a mode cannot do without."""

    STICKS = "sticks"
    SETPOINTS = "setpoints arrive"
    MISSION = "valid mission"
    LOCAL_POSITION = "local position"
    GLOBAL_POSITION = "global position"


# mode_requirements.cpp; attitude and rates, which every mode needs, are always there.
_PLACE = frozenset({Need.LOCAL_POSITION, Need.GLOBAL_POSITION})
NEEDS: dict[Mode, frozenset[Need]] = {
    Mode.ALTCTL: frozenset({Need.STICKS}),
    Mode.POSCTL: frozenset({Need.STICKS, Need.LOCAL_POSITION}),
    Mode.STABILIZED: frozenset({Need.STICKS}),
    Mode.MISSION: _PLACE | {Need.MISSION},
    Mode.LOITER: _PLACE,
    Mode.RETURN: _PLACE,
    Mode.TAKEOFF: frozenset({Need.LOCAL_POSITION}),
    Mode.LAND: frozenset({Need.LOCAL_POSITION}),
    Mode.FOLLOW_TARGET: frozenset({Need.LOCAL_POSITION}),
    Mode.ORBIT: frozenset({Need.LOCAL_POSITION}),
    Mode.OFFBOARD: frozenset({Need.SETPOINTS}),
    Mode.DESCEND: frozenset(),
    Mode.TERMINATION: frozenset(),
}

# mode_req_prevent_arming: nobody can arm in these.
NOT_ARMABLE = frozenset({Mode.LAND, Mode.RETURN, Mode.DESCEND, Mode.FOLLOW_TARGET, Mode.ORBIT, Mode.TERMINATION})
# A vehicle that cannot be armed in its mode, or would take off again at once, goes back after disarming to
# the mode before (UserModeIntention::change). Out of termination nothing leads.
NOT_KEPT_AFTER_DISARMING = (NOT_ARMABLE - {Mode.TERMINATION}) | {Mode.TAKEOFF}


def missing(mode: Mode, available: frozenset[Need]) -> frozenset[Need]:
    """What ``mode`` needs and is not there."""
    return NEEDS[mode] - available


class ModeEvent(StrEnum):
    """What can change the mode that is meant."""

    REQUEST = "requested"
    TAKEOFF_REACHED = "takeoff height reached"
    MISSION_FINISHED = "mission finished in the air"
    STICKS = "sticks moved"
    DISARMED = "disarmed"


class ModeCondition(StrEnum):
    """Condition of a transition."""

    ALWAYS = ""
    ARMED = "armed"
    CAN_RUN = "disarmed, or it can run"


@dataclass(frozen=True, slots=True)
class Transition:
    """One row: from any of ``sources`` (None: from every mode) on ``event`` to ``target``.

    A target of None is the last mode that was meant and in which the vehicle could be armed.
    """

    sources: tuple[Mode, ...] | None
    event: ModeEvent
    guard: ModeCondition
    target: Mode | None


_FLOWN_WITHOUT_STICKS = tuple(mode for mode in Mode if Need.STICKS not in NEEDS[mode] and mode is not Mode.TERMINATION)

# Disarmed, PX4 lets every mode be chosen; armed it wants what the mode needs. LAND may always be chosen, DESCEND never.
# Nothing leads out of TERMINATION: `ModeState` holds it. What a failsafe flies instead of the mode that is meant is
# decided in `failsafe` and never changes what is meant, but for a pilot who takes over.
_ALWAYS_CHOSEN = (Mode.LAND, Mode.TERMINATION)
TRANSITIONS: tuple[Transition, ...] = (
    *(
        Transition(
            None, ModeEvent.REQUEST, ModeCondition.ALWAYS if mode in _ALWAYS_CHOSEN else ModeCondition.CAN_RUN, mode
        )
        for mode in NEEDS
        if mode is not Mode.DESCEND
    ),
    Transition((Mode.TAKEOFF,), ModeEvent.TAKEOFF_REACHED, ModeCondition.ARMED, Mode.LOITER),
    Transition((Mode.MISSION,), ModeEvent.MISSION_FINISHED, ModeCondition.ARMED, Mode.LOITER),
    Transition(_FLOWN_WITHOUT_STICKS, ModeEvent.STICKS, ModeCondition.ARMED, Mode.POSCTL),
    Transition(tuple(sorted(NOT_KEPT_AFTER_DISARMING)), ModeEvent.DISARMED, ModeCondition.ALWAYS, None),
)


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the guards ask about."""

    armed: bool
    available: frozenset[Need] = frozenset()

    def hold(self, guard: ModeCondition, target: Mode | None) -> bool:
        """Whether a transition with this guard may happen."""
        if guard is ModeCondition.ALWAYS:
            return True
        if guard is ModeCondition.ARMED:
            return self.armed
        return not self.armed or (target is not None and not missing(target, self.available))


def find_transition(
    mode: Mode, event: ModeEvent, conditions: Conditions, requested: Mode | None = None
) -> Transition | None:
    """The row of the table that applies; None where the event is refused or means nothing."""
    for row in TRANSITIONS:
        if row.event is not event or (event is ModeEvent.REQUEST and row.target is not requested):
            continue
        if (row.sources is None or mode in row.sources) and conditions.hold(row.guard, row.target):
            return row
    return None


class ModeState:
    """The mode that is meant, moved only along the table, and the mode that flies."""

    def __init__(self) -> None:
        # PX4 boots a multicopter without sticks into Hold.
        self.intended = Mode.LOITER
        self.flown = Mode.LOITER
        """What flies, and what HEARTBEAT shows: ``intended``, or what a failsafe made of it."""
        self._after_disarming = Mode.LOITER

    def apply(self, event: ModeEvent, conditions: Conditions, requested: Mode | None = None) -> bool:
        """Take the event; False where the table has no row for it."""
        if self.flown is Mode.TERMINATION:
            return False
        row = find_transition(self.intended, event, conditions, requested)
        if row is None:
            return False
        self.mean(self._after_disarming if row.target is None else row.target)
        return True

    def mean(self, mode: Mode) -> None:
        """Mean this mode from now on; the commander says what flies."""
        self.intended = mode
        if mode not in NOT_KEPT_AFTER_DISARMING:
            self._after_disarming = mode


@cache
def cannot_run(there_is: frozenset[Need], has_setpoints: bool) -> frozenset[Mode]:
    """The modes that cannot run, as the failsafes count: lost sticks have a row of their own."""
    there = there_is | {Need.STICKS, Need.SETPOINTS} if has_setpoints else (there_is | {Need.STICKS}) - {Need.SETPOINTS}
    return frozenset(mode for mode in Mode if missing(mode, there))
