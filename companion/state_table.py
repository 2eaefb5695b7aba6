"""The table of a state machine: the next state for each trigger."""

from collections.abc import Mapping
from enum import Enum
from typing import Generic, TypeVar

StateT = TypeVar("StateT", bound=Enum)
TriggerT = TypeVar("TriggerT", bound=Enum)


class StateTable(Generic[StateT, TriggerT]):
    """Of each state what moves it on, and to where; the first one is where it begins.

    A trigger that a state does not list leaves it where it is. The values of states and triggers are words for people.
    """

    def __init__(self, rows: Mapping[StateT, Mapping[TriggerT, StateT]]) -> None:
        self.rows = rows
        # Few, and looked for in each step: in a tuple by identity, in a set by the hash of an Enum, which is slow.
        self.final = tuple(state for state, row in rows.items() if not row)

    def moves(self, state: StateT, trigger: TriggerT) -> bool:
        """Whether the trigger means anything in this state."""
        return trigger in self.rows[state]

    def from_which(self, trigger: TriggerT) -> tuple[StateT, ...]:
        """The states in which the trigger means something."""
        return tuple(state for state, row in self.rows.items() if trigger in row)

    def next_state(self, state: StateT, trigger: TriggerT) -> StateT:
        return self.rows[state].get(trigger, state)
