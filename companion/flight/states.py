"""The flight's state machine: one table, everything else is derived from it."""

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


class Trigger(Enum):
    """What moves the flight on; of two in the same step the one listed earlier counts."""

    CONTROL_LOST = "pilot, failsafe or disarm took over"
    REFUSED = "the vehicle cannot or will not fly"
    INTERRUPTED = "stop, silent link, abort condition or a step that did not end in time"
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
    DISARMED = "vehicle disarmed itself"


# A trigger that a state does not list leaves the flight where it is.
TABLE: Mapping[State, Mapping[Trigger, State]] = {
    State.CONNECT: {
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.REFUSED: State.ABORTED,
        Trigger.VEHICLE_READY: State.READY,
    },
    State.READY: {
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.REFUSED: State.ABORTED,
        Trigger.PLAN_CONFIRMED: State.TAKEOFF,
    },
    State.TAKEOFF: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.REFUSED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.TAKEN_OFF: State.MISSION,
    },
    State.MISSION: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.RETURN_DUE: State.RETURNING,
        Trigger.LAND_DUE: State.LANDING,
    },
    State.RECOVERING: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.RECOVERED_TO_HOLD: State.HOLDING,
        Trigger.RECOVERED_TO_CONTINUE: State.MISSION,
        Trigger.RECOVERED_TO_RETRY: State.MISSION,
        Trigger.RECOVERED_TO_DETOUR: State.MISSION,
        Trigger.RECOVERED_TO_RETURN: State.RETURNING,
        Trigger.RECOVERED_TO_LAND: State.LANDING,
        Trigger.RECOVERED_TO_ABORT: State.ABORTED,
    },
    State.HOLDING: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.HOLD_ENDED: State.MISSION,
    },
    State.RETURNING: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.HOME_REACHED: State.LANDING,
        Trigger.LAND_DUE: State.LANDING,
    },
    State.LANDING: {
        Trigger.CONTROL_LOST: State.ABORTED,
        Trigger.INTERRUPTED: State.ABORTED,
        Trigger.COLLISION: State.RECOVERING,
        Trigger.DISARMED: State.DONE,
    },
    State.DONE: {},
    State.ABORTED: {},
}

FINAL_STATES = frozenset(state for state, row in TABLE.items() if not row)


def moves(state: State, trigger: Trigger) -> bool:
    """Whether the trigger means anything in this state."""
    return trigger in TABLE[state]


def next_state(state: State, trigger: Trigger) -> State:
    """The table, completed by its rule for triggers that are not listed."""
    return TABLE[state].get(trigger, state)


def mermaid_diagram() -> str:
    """The table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {State.CONNECT.value}"]
    for state, row in TABLE.items():
        lines += [f"    {state.value} --> {target.value}: {trigger.value}" for trigger, target in row.items()]
    lines += [f"    {state.value} --> [*]" for state in TABLE if state in FINAL_STATES]
    return "\n".join(lines) + "\n"


def markdown_table() -> str:
    """The table in Markdown, one row a transition."""
    lines = ["| state | trigger | next state |", "|---|---|---|"]
    for state, row in TABLE.items():
        lines += [f"| {state.value} | {trigger.value} | {target.value} |" for trigger, target in row.items()]
    return "\n".join(lines) + "\n"
