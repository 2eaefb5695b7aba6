"""The page of state machines, from their tables."""

from enum import Enum
from typing import Any

from bench.reference.markdown import table
from companion.flight.states import TABLE as FLIGHT
from companion.guard.states import TABLE as GUARD
from companion.state_table import StateTable
from sim_vehicle.autopilot.commander.failsafe_table import markdown_table as failsafe_table
from sim_vehicle.autopilot.modes import mode_diagram


def states() -> dict[str, str]:
    """Diagrams are Mermaid's, which GitHub and the site draw."""
    return {
        "flight_diagram": mermaid_diagram(FLIGHT),
        "flight": transitions(FLIGHT),
        "guard_diagram": mermaid_diagram(GUARD),
        "guard": transitions(GUARD),
        "modes": mode_diagram(),
        "failsafes": failsafe_table(),
    }


def mermaid_diagram(states: StateTable[Any, Any]) -> str:
    """Which state leads to which, each arrow once; a state's words are one name there."""
    arrows = [f"    [*] --> {_name(next(iter(states.rows)))}"]
    for state, row in states.rows.items():
        arrows += [f"    {_name(state)} --> {_name(target)}" for target in row.values() if target is not state]
    arrows += [f"    {_name(state)} --> [*]" for state in states.rows if state in states.final]
    return "\n".join(["stateDiagram-v2", *dict.fromkeys(arrows)]) + "\n"


def transitions(states: StateTable[Any, Any]) -> str:
    """A Markdown table: a row a trigger and what it leads to, with the states in which it does."""
    sources: dict[tuple[str, str], list[str]] = {}
    for state, row in states.rows.items():
        for trigger, target in row.items():
            sources.setdefault((trigger.value, target.value), []).append(state.value)
    rows = [(trigger, ", ".join(inside), target) for (trigger, target), inside in sources.items()]
    return table(("trigger", "in", "leads to"), rows)


def _name(state: Enum) -> str:
    return str(state.value).replace(" ", "_")
