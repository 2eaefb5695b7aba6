"""The flight's state machine: one table, from which everything else follows."""

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """Where the flight is; the value is the word shown to people."""

    CONNECT = "connect"
    READY = "ready"
    TAKEOFF = "takeoff"
    MISSION = "mission"
    RECOVERING = "recovering"
    HOLDING = "holding"
    RETURNING = "returning"
    LANDING = "landing"
    DONE = "done"
    ABORTED = "aborted"
    CRASHED = "crashed"


class Trigger(Enum):
    """What moves the flight on; of two in the same step the one listed earlier counts."""

    CONTROL_LOST = "pilot, failsafe or disarm took over"
    REFUSED = "the vehicle cannot or will not fly"
    INTERRUPTED = "stop, silent link, abort condition or a step that did not end in time"
    LINK_RESTORED = "the link is back after a silence, as after a restart"
    CRASHED = "tipped over, on the floor after a hit, or pressed to something"
    COLLISION = "hit detected"
    VEHICLE_READY = "identified, streams fast enough"
    PLAN_CONFIRMED = "person confirmed the plan"
    TAKEN_OFF = "height reached"
    RECOVERED_TO_HOLD = "settled, then: hold"
    RECOVERED_TO_CONTINUE = "settled, then: continue"
    RECOVERED_TO_RETRY = "settled, then: retry"
    RECOVERED_TO_DETOUR = "settled, then: detour"
    RECOVERED_TO_RETURN = "settled, then: return"
    RECOVERED_TO_LAND = "settled, then: land"
    RECOVERED_TO_ABORT = "settled, then: abort"
    HOLD_ENDED = "hold time over"
    RETURN_DUE = "next item is return, or a time-out or a goal out of reach says so"
    LAND_DUE = "next item is land, or a time-out or a goal out of reach says so"
    HOME_REACHED = "above the arming position"
    DISARMED = "vehicle disarmed"
    FLIES_AGAIN = "upright and above the ground again"


# What ends a flight wherever it is in the air, and what interrupts it.
_IN_THE_AIR: Mapping[Enum, State] = {
    Trigger.CONTROL_LOST: State.ABORTED,
    Trigger.INTERRUPTED: State.ABORTED,
    Trigger.CRASHED: State.CRASHED,
    Trigger.COLLISION: State.RECOVERING,
}
_ON_THE_GROUND: Mapping[Enum, State] = {
    Trigger.INTERRUPTED: State.ABORTED,
    Trigger.REFUSED: State.ABORTED,
    Trigger.LINK_RESTORED: State.CONNECT,
}
# Of each state what moves it on, and to where; the first one is where it begins. Other triggers leave it where it is.
TABLE: Mapping[State, Mapping[Enum, State]] = {
    State.CONNECT: {**_ON_THE_GROUND, Trigger.VEHICLE_READY: State.READY},
    State.READY: {**_ON_THE_GROUND, Trigger.PLAN_CONFIRMED: State.TAKEOFF},
    State.TAKEOFF: {**_IN_THE_AIR, Trigger.REFUSED: State.ABORTED, Trigger.TAKEN_OFF: State.MISSION},
    State.MISSION: {**_IN_THE_AIR, Trigger.RETURN_DUE: State.RETURNING, Trigger.LAND_DUE: State.LANDING},
    State.RECOVERING: {
        **_IN_THE_AIR,
        Trigger.RECOVERED_TO_HOLD: State.HOLDING,
        Trigger.RECOVERED_TO_CONTINUE: State.MISSION,
        Trigger.RECOVERED_TO_RETRY: State.MISSION,
        Trigger.RECOVERED_TO_DETOUR: State.MISSION,
        Trigger.RECOVERED_TO_RETURN: State.RETURNING,
        Trigger.RECOVERED_TO_LAND: State.LANDING,
        Trigger.RECOVERED_TO_ABORT: State.ABORTED,
    },
    State.HOLDING: {**_IN_THE_AIR, Trigger.HOLD_ENDED: State.MISSION},
    State.RETURNING: {**_IN_THE_AIR, Trigger.HOME_REACHED: State.LANDING, Trigger.LAND_DUE: State.LANDING},
    State.LANDING: {**_IN_THE_AIR, Trigger.DISARMED: State.DONE},
    State.DONE: {},
    State.ABORTED: {},
    State.CRASHED: {
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.DISARMED: State.ABORTED,
        Trigger.FLIES_AGAIN: State.ABORTED,
    },
}

# Few, and looked for in each step: in a tuple by identity, in a set by the hash of an Enum, which is slow.
FINAL_STATES = tuple(state for state, row in TABLE.items() if not row)
# Where hits and crashes are looked for: climb and descent belong to it; the height decides about the ground.
IN_THE_AIR = tuple(state for state, row in TABLE.items() if Trigger.CRASHED in row)
