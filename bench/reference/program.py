"""The pages of what the programs do: commands, events, MAVLink messages and state machines, from their code."""

import argparse
import ast
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import bench.main
import rebound_cli.main
from bench.reference.markdown import MEANINGS, code, table
from companion.flight.states import TABLE as FLIGHT
from companion.guard.machine import _KINDS
from companion.guard.states import TABLE as GUARD
from companion.mavlink import encode, readers
from companion.reflex.classify import TABLE as IMPACTS
from companion.state_table import StateTable
from rebound_cli import exit_codes
from sim_vehicle.autopilot.commander.failsafe_table import OFFBOARD_LOSS, ROWS, Action
from sim_vehicle.autopilot.modes import NEEDS, TRANSITIONS, ModeCondition, Transition

ROOT = Path(__file__).parents[2]
# What is told under a kind that stands in no call.
ELSEWHERE = frozenset({"late", "lost", "guard", *_KINDS.values()})
_EXITS = (
    (0, "Done as asked.", "It stays ended."),
    (exit_codes.ERROR, "Failed: no vehicle, no device, a mission not completed, a check that says `no`.", "Restarted."),
    (exit_codes.USAGE, "The command line cannot be read.", "It stays ended: correct it, then `install`."),
    (exit_codes.CONFIGURATION, "The configuration is wrong: a file, a setting, an address, a key.", "It stays ended."),
    (exit_codes.INTERRUPTED, "Ctrl-C twice: ended at once.", "Restarted."),
)


def commands() -> dict[str, str]:
    return {
        "commands": table(("command", "does", "more"), _commands(rebound_cli.main.build_parser())),
        "studies": table(("study", "does", "more"), _commands(bench.main.build_parser())),
        "error": str(exit_codes.ERROR),
        "exits": table(("code", "meaning", "a guard as a service"), _EXITS),
    }


def _commands(parser: argparse.ArgumentParser, does: str = "") -> Iterator[tuple[str, str, str]]:
    """Those that run something, each with all words of its name and the page that its description names."""
    if parser.get_default("run") is not None:
        page = re.search(r"docs/([\w/-]+)\.md", parser.description or "")
        yield code(parser.prog), does, f"[{page[1].rpartition('/')[2]}](../{page[1]}.md)" if page else ""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for said in action._choices_actions:
                yield from _commands(action.choices[said.dest], said.help or "")


def events() -> dict[str, str]:
    told = data_keys()
    rows = [
        (code(kind), meaning, ", ".join(map(code, told.get(kind, ())))) for kind, meaning in MEANINGS["events"].items()
    ]
    impacts = [(row.kind.value, row.criterion) for row in IMPACTS]
    return {"events": table(("kind", "meaning", "data"), rows), "impacts": table(("kind", "criterion"), impacts)}


def data_keys() -> dict[str, list[str]]:
    """Of each kind that a call in the companion tells the keys of its data."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "companion").rglob("*.py")):
        for call in _calls(ast.parse(path.read_text(encoding="utf-8"))):
            at = {"report": 1, "Notice": 0}[_callee(call)]
            kind = call.args[at] if len(call.args) > at else None
            if isinstance(kind, ast.Constant) and isinstance(kind.value, str):
                written = [key for data in call.args if isinstance(data, ast.Dict) for key in data.keys]
                words = [key.value for key in written if isinstance(key, ast.Constant)]
                words += [word.arg for word in call.keywords]
                keys = found.setdefault(kind.value, [])
                keys += [word for word in words if isinstance(word, str) and word not in keys]
    return found


def _calls(tree: ast.AST) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _callee(node) in ("report", "Notice"):
            yield node


def _callee(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def messages() -> dict[str, str]:
    read = [(code(name), ", ".join(map(code, reader._names))) for name, reader in sorted(readers._BY_NAME.items())]
    return {"received": table(("message", "fields"), read), "sent": ", ".join(map(code, sorted(_sent())))}


def _sent() -> set[str]:
    """By pymavlink's encoders and classes that the encoder names."""
    found = re.findall(r"\.(?:MAVLink_(\w+)_message|(\w+)_encode)\b", inspect.getsource(encode))
    return {(of_class or of_call).upper() for of_class, of_call in found}


def states() -> dict[str, str]:
    """Diagrams are Mermaid's, which GitHub and the site draw."""
    return {
        "flight_diagram": mermaid_diagram(FLIGHT),
        "flight": transitions(FLIGHT),
        "guard_diagram": mermaid_diagram(GUARD),
        "guard": transitions(GUARD),
        "modes": table(("event", "in", "leads to", "if"), map(_mode_row, TRANSITIONS)),
        "failsafes": table(("trigger", "parameter", "does", "ends"), _failsafes()),
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


def _mode_row(row: Transition) -> tuple[str, str, str, str]:
    """Of the simulated vehicle's modes."""
    where = ", ".join(mode.name for mode in row.sources) if row.sources else "any mode"
    condition = row.guard.value
    if row.guard is ModeCondition.CAN_RUN and row.target is not None:
        condition = f"disarmed, or there is: {', '.join(sorted(NEEDS[row.target]))}"
    return row.event.value, where, row.target.name if row.target is not None else "the mode before", condition


def _failsafes() -> Iterator[tuple[str, str, str, str]]:
    """The simulated vehicle's, what is no row of its table at the end."""
    for row in ROWS:
        actions = {str(value): response.action for value, response in row.responses.items()}
        if row.otherwise.action is not Action.NONE:
            actions["else"] = row.otherwise.action
        ends = {response.clears.value for response in row.responses.values() if response.action > Action.WARN}
        yield row.trigger.value, code(row.parameter), _done(actions), ", or ".join(sorted(ends))
    losses = {str(value): action for value, (action, _) in OFFBOARD_LOSS.items()}
    yield "setpoints stopped in OFFBOARD", code("COM_OBL_RC_ACT"), _done(losses), "with the trigger"
    yield "mode cannot run", "", "a mode of sticks: the next that needs less; else return", "with the trigger"


def _done(actions: dict[str, Action]) -> str:
    return ", ".join(f"{value}: {action.name.lower().replace('_', ' ')}" for value, action in actions.items())


def _name(state: Enum) -> str:
    return str(state.value).replace(" ", "_")
