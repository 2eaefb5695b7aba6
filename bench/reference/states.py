"""The page of state machines and of what imports what, from the tables and the imports themselves."""

from enum import Enum
from pathlib import Path
from typing import Any

from bench.import_graph import package_diagram
from companion.flight.states import TABLE as FLIGHT
from companion.guard.states import TABLE as GUARD
from companion.state_table import StateTable
from sim_vehicle.autopilot.commander.failsafe_table import markdown_table as failsafe_table
from sim_vehicle.autopilot.modes import mode_diagram

ROOT = Path(__file__).parents[2]


def states_page() -> str:
    """Diagrams are Mermaid's, which GitHub and the site draw."""
    return "\n".join(
        [
            "# State machines",
            "",
            "A trigger that a state does not list leaves the state as it is.",
            "",
            "## The flight",
            "",
            "`companion/flight/states.py` is the source.",
            "",
            f"```mermaid\n{mermaid_diagram(FLIGHT)}```",
            "",
            markdown_table(FLIGHT),
            "## The guard",
            "",
            "`companion/guard/states.py` is the source.",
            "",
            f"```mermaid\n{mermaid_diagram(GUARD)}```",
            "",
            markdown_table(GUARD),
            "## The simulated vehicle's modes",
            "",
            "`sim_vehicle/autopilot/modes.py` is the source.",
            "",
            f"```mermaid\n{mode_diagram().rstrip()}\n```",
            "",
            "## The simulated vehicle's failsafes",
            "",
            "`sim_vehicle/autopilot/commander/failsafe_table.py` is the source. Of several actions the vehicle takes "
            "the one that stands last in `Action`.",
            "",
            failsafe_table(),
            "## Which package imports which",
            "",
            "An arrow leads from a package to one that it imports.",
            "",
            f"```mermaid\n{package_diagram(ROOT)}```",
        ]
    )


def mermaid_diagram(table: StateTable[Any, Any]) -> str:
    """A Mermaid state diagram; a state's words are one name there."""
    lines = ["stateDiagram-v2", f"    [*] --> {_name(next(iter(table.rows)))}"]
    for state, row in table.rows.items():
        lines += [f"    {_name(state)} --> {_name(target)}: {trigger.value}" for trigger, target in row.items()]
    lines += [f"    {_name(state)} --> [*]" for state in table.rows if state in table.final]
    return "\n".join(lines) + "\n"


def markdown_table(table: StateTable[Any, Any]) -> str:
    """A Markdown table, one row a transition."""
    lines = ["| state | trigger | next state |", "|---|---|---|"]
    for state, row in table.rows.items():
        lines += [f"| {state.value} | {trigger.value} | {target.value} |" for trigger, target in row.items()]
    return "\n".join(lines) + "\n"


def _name(state: Enum) -> str:
    return str(state.value).replace(" ", "_")
