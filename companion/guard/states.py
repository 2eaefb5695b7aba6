"""The guard's state machine: one table, from which everything else follows."""

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """What the guard is doing; the value is the word shown to people."""

    CONNECTING = "connecting"
    STANDING_BY = "standing by"
    WATCHING = "watching"
    TAKING_OVER = "taking over"
    RECOVERING = "recovering"
    GIVING_BACK = "giving back"
    STOOD_DOWN = "stood down"
    ENDED = "ended"
    CRASHED = "crashed"


class Trigger(Enum):
    """What moves the guard on; of two in the same step the one listed earlier counts."""

    DISARMED = "vehicle disarmed"
    CONTROL_LOST = "pilot, failsafe or another program took over, or the link fell silent"
    REFUSED = "no vehicle that can be guarded"
    STOPPED = "asked to stop"
    CRASHED = "tipped over, on the floor after a hit, or pressed to something"
    HIT = "hit detected"
    LEADS_BACK = "a program's setpoints lead into what was hit"
    CONNECTED = "identified, streams fast enough"
    WORTH_GUARDING = "armed, off the ground, in a mode that may be taken over"
    NOT_TO_GUARD = "landing, or in a mode that may not be taken over"
    CONFIRMED = "OFFBOARD confirmed"
    NOT_CONFIRMED = "OFFBOARD refused or not confirmed in time"
    POSITION_SILENT = "position silent"
    SETTLED = "settled, or not in time"
    GIVEN_BACK = "mode confirmed"
    STREAMS_GONE = "the vehicle speaks, its streams have ended, or may have in a silence"
    ENABLED = "person enabled it again"
    FLIES_AGAIN = "upright and above the ground again"


# What ends the holding in every state.
_RELEASED = {
    Trigger.DISARMED: State.STANDING_BY,
    Trigger.CONTROL_LOST: State.STOOD_DOWN,
    Trigger.CRASHED: State.CRASHED,
}
# Of each state what moves it on, and to where; the first one is where it begins. Other triggers leave it where it is.
TABLE: Mapping[State, Mapping[Trigger, State]] = {
    State.CONNECTING: {
        Trigger.REFUSED: State.ENDED,
        Trigger.STOPPED: State.ENDED,
        Trigger.STREAMS_GONE: State.CONNECTING,
        Trigger.CONNECTED: State.STANDING_BY,
    },
    State.STANDING_BY: {
        Trigger.STOPPED: State.ENDED,
        Trigger.WORTH_GUARDING: State.WATCHING,
        Trigger.STREAMS_GONE: State.CONNECTING,
    },
    State.WATCHING: {
        Trigger.DISARMED: State.STANDING_BY,
        Trigger.STOPPED: State.ENDED,
        Trigger.CRASHED: State.CRASHED,
        Trigger.HIT: State.TAKING_OVER,
        Trigger.LEADS_BACK: State.GIVING_BACK,
        Trigger.NOT_TO_GUARD: State.STANDING_BY,
    },
    State.TAKING_OVER: {
        **_RELEASED,
        Trigger.STOPPED: State.GIVING_BACK,
        Trigger.HIT: State.TAKING_OVER,
        Trigger.CONFIRMED: State.RECOVERING,
        Trigger.NOT_CONFIRMED: State.GIVING_BACK,
        Trigger.POSITION_SILENT: State.GIVING_BACK,
        Trigger.SETTLED: State.GIVING_BACK,
    },
    State.RECOVERING: {
        **_RELEASED,
        Trigger.STOPPED: State.GIVING_BACK,
        Trigger.HIT: State.RECOVERING,
        Trigger.POSITION_SILENT: State.GIVING_BACK,
        Trigger.SETTLED: State.GIVING_BACK,
    },
    State.GIVING_BACK: {
        **_RELEASED,
        Trigger.STOPPED: State.GIVING_BACK,
        Trigger.HIT: State.TAKING_OVER,
        Trigger.GIVEN_BACK: State.WATCHING,
    },
    State.STOOD_DOWN: {
        Trigger.DISARMED: State.STANDING_BY,
        Trigger.STOPPED: State.ENDED,
        Trigger.ENABLED: State.STANDING_BY,
    },
    State.ENDED: {},
    State.CRASHED: {
        Trigger.DISARMED: State.STANDING_BY,
        Trigger.STOPPED: State.ENDED,
        Trigger.FLIES_AGAIN: State.STANDING_BY,
    },
}

# While it is in one of these the vehicle flies, or is about to fly, by the guard's setpoints.
HOLDING = (State.TAKING_OVER, State.RECOVERING, State.GIVING_BACK)
MAY_CRASH = tuple(state for state, row in TABLE.items() if Trigger.CRASHED in row)
