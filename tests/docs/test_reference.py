"""The generated pages are those of the code, and say something of everything."""

import pytest

from bench.reference import program
from bench.reference.command import FOLDER, PAGES, page_text
from bench.reference.markdown import MEANINGS
from bench.reference.program import mermaid_diagram, transitions
from companion.flight import states as flight_states
from companion.guard import states as guard_states
from rebound_cli import exit_codes
from rebound_cli.results.summary import Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth
from tests.rebound_cli.results.test_truth_match import EPOCH_US, FACTS, collision, hit, path_of, report_of


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_as_the_code_has_it(name):
    assert (FOLDER / name).read_text(encoding="utf-8") == page_text(name), "run `make docs`"


def test_every_kind_of_event_has_its_meaning():
    assert set(program.data_keys()) | program.ELSEWHERE == set(MEANINGS["events"])


@pytest.mark.parametrize("states", [flight_states.TABLE, guard_states.TABLE], ids=["flight", "guard"])
def test_diagram_and_table_show_every_transition(states):
    diagram = mermaid_diagram(states)
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in transitions(states).splitlines()]
    for state, row in states.rows.items():
        for trigger, target in row.items():
            arrow = f"{state.value} --> {target.value}\n".replace(" ", "_").replace("_-->_", " --> ")
            assert state is target or arrow in diagram
            (inside,) = [where for what, where, to in rows if (what, to) == (trigger.value, target.value)]
            assert state.value in inside.split(", ")


def test_every_key_of_the_summary_has_its_meaning():
    # Given a flight with one collision, of which the simulator knows the contact
    truth = FlightTruth([hit(10_000)], path_of([(10.0, 3.8, -1.5)]), EPOCH_US)
    found = build_summary(Flown(report_of(collision(10_004)), 0.5, truth), FACTS)
    # Then the page explains just the keys that there are
    (entry,) = found["collisions"]
    assert set(found) == set(MEANINGS["flight"])
    assert set(entry) == set(MEANINGS["collision"])
    assert set(entry["truth"]) == set(MEANINGS["truth"])


def test_the_exit_codes_are_those_of_the_program():
    text = page_text("commands.md").partition("## Exit codes")[2]
    codes = [int(line.split("|")[1]) for line in text.splitlines() if line[2:3].isdecimal()]
    assert codes == [0, exit_codes.ERROR, exit_codes.USAGE, exit_codes.CONFIGURATION, exit_codes.INTERRUPTED]
