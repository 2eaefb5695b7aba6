"""The ablation: a copy of a flight goes on without a rule from where the rule first matters."""

import importlib

import pytest

from bench.studies.ablation import RULES, Rule, flights_table, switched
from companion.reflex import attitude_law, surface

RULE = Rule("away", "away from what was hit", "reflex.surface:plus", says=[9, 9, 9])
NOT_RECOVERED = {"recovered": False}
RECOVERED = {"past_m": 0.02, "lost_m": 0.03, "rest_s": 1.2, "normal_deg": 5.0, "recovered": True}


def flown(copies):
    """Three steps, of which the second is the rule's."""
    steps = [("first",), surface.plus((0, 0, 0), 1.0, (1, 0, 0)), attitude_law.plus((1, 0, 0), 1.0, (1, 0, 0))]
    copies.leave(lambda: {"steps": steps})
    return steps


def test_a_copy_goes_on_without_the_rule_and_the_first_flight_with_it():
    with switched([RULE]) as copies:
        steps = flown(copies)
    assert steps == [("first",), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    # In the copy the rule is off from its first answer on, in every module that asks it.
    assert copies.found == {"away": {"steps": [["first"], [9, 9, 9], [9, 9, 9]]}}


def test_where_a_rule_changes_nothing_there_is_no_copy():
    same = Rule("same", "", "reflex.surface:plus", says=[1.0, 0.0, 0.0])
    with switched([same]) as copies:
        assert surface.plus((0, 0, 0), 1.0, (1, 0, 0)) == (1.0, 0.0, 0.0)
    assert copies.found == {}


def test_a_copy_that_fails_is_told():
    def failing():
        raise ValueError

    with switched([RULE]) as copies:
        surface.plus((0, 0, 0), 1.0, (1, 0, 0))
        copies.leave(failing)
    assert "ValueError" in copies.found["away"]["error"]


@pytest.mark.parametrize("rule", RULES, ids=[rule.name for rule in RULES])
def test_every_rule_is_a_function_of_the_companion(rule):
    module, _, path = rule.place.partition(":")
    found = importlib.import_module(f"companion.{module}")
    for name in path.split("."):
        found = getattr(found, name)
    assert callable(found) or isinstance(found, property)


def test_the_table_counts_what_is_lost_without_a_rule():
    well = {"ends": True, "hits": [RECOVERED]}
    lost = [{"ends": ends, "hits": [RECOVERED | NOT_RECOVERED]} for ends in (False, True)]
    flights = [{"with": well, "without": {"trust": without}} for without in lost]
    lines = flights_table(flights).splitlines()
    trust = next(line for line in lines if line.startswith("| trust"))
    assert [cell.strip() for cell in trust.split("|")][3:6] == ["2", "+1", "+2"]
    hand = next(line for line in lines if line.startswith("| hand "))
    assert [cell.strip() for cell in hand.split("|")][3:] == ["0", "+0", "+0", *["–"] * 5, ""]
