"""The reference is that of the code, and says something of everything."""

import ast
import enum
import inspect
import re
from types import ModuleType

import pytest
from pydantic import BaseModel

import companion.mavsdk
import sim_vehicle.testing
from bench.reference.command import FOLDER, PAGES, ROOT, mermaid_diagram, page_text, transitions
from companion.flight import states as flight_states
from companion.guard import states as guard_states
from companion.guard.machine import _KINDS
from companion.reflex.detection.classify import TABLE as IMPACTS
from rebound_cli import exit_codes
from rebound_cli.results.summary import Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth
from sim_vehicle.autopilot.commander.failsafe_table import ROWS
from sim_vehicle.autopilot.modes import TRANSITIONS
from tests.bench.random_missions import made_up
from tests.rebound_cli.results.test_results import EPOCH_US, FACTS, collision, hit, path_of

# What is told under a kind that stands in no call.
ELSEWHERE = {"late", "lost", "guard", *_KINDS.values()}


def rows_below(page, heading):
    """The cells of the table of a page written by hand, by its heading, without the heads."""
    section = (FOLDER / page).read_text(encoding="utf-8").split(f"# {heading}\n", 1)[1].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:]]


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_as_the_code_has_it(name):
    assert (FOLDER / name).read_text(encoding="utf-8") == page_text(name), "run `make docs`"


def told():
    """Of each kind that a call in the companion tells the keys of its data."""
    found = {}
    for path in (ROOT / "companion").rglob("*.py"):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            name = getattr(call.func, "attr", getattr(call.func, "id", "")) if isinstance(call, ast.Call) else ""
            at = {"report": 1, "Notice": 0}.get(name, 99)
            kind = call.args[at] if name and len(call.args) > at else None
            if isinstance(kind, ast.Constant) and isinstance(kind.value, str):
                written = [key for data in call.args if isinstance(data, ast.Dict) for key in data.keys]
                words = {key.value for key in written if isinstance(key, ast.Constant)}
                found.setdefault(kind.value, set()).update(words | {word.arg for word in call.keywords if word.arg})
    return found


def test_every_kind_of_event_and_of_impact_is_told_with_its_data():
    said = {kind.strip("`"): set(re.findall(r"`(\w+)`", data)) for kind, _, data in rows_below("events.md", "Events")}
    found = told()
    assert said == {kind: found.get(kind, set()) for kind in {*found} | ELSEWHERE}
    assert rows_below("events.md", "Kinds of impact") == [[kind.value, criterion] for kind, criterion, _ in IMPACTS]


def public(name, value):
    """What a program may use of it: each with its name; keys of models and words of enumerations stand in their row."""
    yield name, value
    if isinstance(value, type) and issubclass(value, BaseModel | enum.Enum | Exception):
        return
    members = vars(value).items() if isinstance(value, type | ModuleType) else ()
    for inner, member in members:
        is_own = not isinstance(value, ModuleType) or getattr(member, "__module__", "") == value.__name__
        is_said = inner.islower() and not inner.startswith("_") and (name, inner) != ("faults", "opposite")
        if is_own and is_said and (inspect.isfunction(member) or isinstance(member, property)):
            yield f"{name}.{inner}", member


@pytest.mark.parametrize("module", [companion.mavsdk, sim_vehicle.testing], ids=lambda module: module.__name__)
def test_the_python_api_names_what_there_is_and_its_arguments(module):
    rows = [cell.strip("`").partition("(") for cell, _ in rows_below("python-api.md", module.__name__)]
    said = {name: re.findall(r"(?:^|, )\*{0,2}(\w+)", re.sub(r"=\([^)]*\)", "", rest)) for name, _, rest in rows}
    found = {one: value for name in module.__all__ for one, value in public(name, getattr(module, name))}
    assert set(said) == set(found)
    for name in (name for name, bracket, _ in rows if bracket):
        assert [each for each in inspect.signature(found[name]).parameters if each != "self"] == said[name], name


@pytest.mark.parametrize("states", [flight_states.TABLE, guard_states.TABLE], ids=["flight", "guard"])
def test_diagram_and_table_show_every_transition(states):
    diagram = mermaid_diagram(states)
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in transitions(states).splitlines()]
    for state, row in states.items():
        for trigger, target in row.items():
            arrow = f"{state.value} --> {target.value}\n".replace(" ", "_").replace("_-->_", " --> ")
            assert state is target or arrow in diagram
            (inside,) = [where for what, where, to in rows if (what, to) == (trigger.value, target.value)]
            assert state.value in inside.split(", ")


def test_the_simulated_vehicles_modes_and_failsafes_are_all_named():
    modes = [(event, target) for event, _, target, _ in rows_below("states.md", "The simulated vehicle's modes")]
    targets = {row: row.target.name if row.target is not None else "the mode before" for row in TRANSITIONS}
    assert modes == [(row.event.value, targets[row]) for row in TRANSITIONS]
    failsafes = rows_below("states.md", "The simulated vehicle's failsafes")
    named = [(row.trigger.value, f"`{row.parameter}`" if row.parameter else "") for row in ROWS]
    assert [(trigger, parameter) for trigger, parameter, _, _ in failsafes][: len(named)] == named
    for row, (_, _, does, _) in zip(ROWS, failsafes, strict=False):
        actions = {value: answer.action.name.lower().replace("_", " ") for value, answer in row.responses.items()}
        assert all(f"{value}: {action}" in does for value, action in actions.items())


def test_every_key_of_the_summary_has_its_meaning():
    # Given a flight with one collision, of which the simulator knows the contact
    truth = FlightTruth([hit(10_000)], path_of([(10.0, 3.8, -1.5)]), EPOCH_US)
    found = build_summary(Flown(made_up.report(collision(10_004)), 0.5, truth), *FACTS)
    # Then the page explains just the keys that there are
    (entry,) = found["collisions"]
    headings = {
        "The flight": found,
        "A collision, by telemetry": entry,
        "The same, by the simulator's truth": entry["truth"],
    }
    for heading, keys in headings.items():
        assert {row[0].strip("`") for row in rows_below("summary.md", heading)} == set(keys)


def test_the_exit_codes_are_those_of_the_program():
    codes = [int(row[0]) for row in rows_below("commands.md", "Exit codes")]
    assert codes == [0, exit_codes.ERROR, exit_codes.USAGE, exit_codes.CONFIGURATION, exit_codes.INTERRUPTED]
