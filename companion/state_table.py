"""What every state machine's table gives: the next state, and its own picture."""

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
        self.final = frozenset(state for state, row in rows.items() if not row)

    def moves(self, state: StateT, trigger: TriggerT) -> bool:
        """Whether the trigger means anything in this state."""
        return trigger in self.rows[state]

    def next_state(self, state: StateT, trigger: TriggerT) -> StateT:
        return self.rows[state].get(trigger, state)

    def mermaid_diagram(self) -> str:
        """As a Mermaid state diagram; a state's words are one name there."""
        lines = ["stateDiagram-v2", f"    [*] --> {_name(next(iter(self.rows)))}"]
        for state, row in self.rows.items():
            lines += [f"    {_name(state)} --> {_name(target)}: {trigger.value}" for trigger, target in row.items()]
        lines += [f"    {_name(state)} --> [*]" for state in self.rows if state in self.final]
        return "\n".join(lines) + "\n"

    def markdown_table(self) -> str:
        """In Markdown, one row a transition."""
        lines = ["| state | trigger | next state |", "|---|---|---|"]
        for state, row in self.rows.items():
            lines += [f"| {state.value} | {trigger.value} | {target.value} |" for trigger, target in row.items()]
        return "\n".join(lines) + "\n"


def _name(state: Enum) -> str:
    return str(state.value).replace(" ", "_")
