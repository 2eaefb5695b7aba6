"""The ablation: a copy of a flight goes on without a rule from where the rule first matters."""

import importlib

import pytest

from bench.ablation.command import table
from bench.ablation.flights import ablation_campaign
from bench.ablation.rules import RULES, Rule
from bench.ablation.switching import switched
from bench.campaign.run import Results
from companion.recovery import direction, room

RULE = Rule("away", "away from what was hit", "companion.recovery.direction:plus", lambda arguments, found: (9, 9, 9))
RECOVERED = {"past_m": 0.02, "lost_m": 0.03, "risen_m": 0.0, "returned": 0, "rest_s": 1.2, "normal_deg": 5.0}


def flown(copies):
    """Three steps, of which the second is the rule's."""
    steps = [("first",), direction.plus((0, 0, 0), 1.0, (1, 0, 0)), room.plus((1, 0, 0), 1.0, (1, 0, 0))]
    copies.leave(lambda: {"steps": steps})
    return steps


def test_a_copy_goes_on_without_the_rule_and_the_first_flight_with_it():
    with switched([RULE]) as copies:
        steps = flown(copies)
    assert steps == [("first",), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    # In the copy the rule is off from its first answer on, in every module that asks it.
    assert copies.found == {"away": {"steps": [["first"], [9, 9, 9], [9, 9, 9]]}}


def test_where_a_rule_changes_nothing_there_is_no_copy():
    same = Rule("same", "", "companion.recovery.direction:plus", lambda arguments, found: found)
    with switched([same]) as copies:
        flown(copies)
    assert copies.found == {}


def test_afterwards_the_companion_is_as_it_was():
    before = direction.plus, room.plus
    with switched([RULE]):
        assert direction.plus is not before[0] and room.plus is not before[1]
    assert (direction.plus, room.plus) == before


def test_a_copy_that_fails_is_told():
    def failing():
        raise ValueError

    with switched([RULE]) as copies:
        direction.plus((0, 0, 0), 1.0, (1, 0, 0))
        copies.leave(failing)
    assert copies.found == {"away": {"failure": "the copy died"}}


@pytest.mark.parametrize("rule", RULES, ids=[rule.name for rule in RULES])
def test_every_rule_is_a_function_of_the_companion(rule):
    module, _, path = rule.place.partition(":")
    found = importlib.import_module(module)
    for name in path.split("."):
        found = getattr(found, name)
    assert callable(found) or isinstance(found, property)


def test_the_table_counts_what_is_lost_without_a_rule():
    campaign = ablation_campaign(1, 7, ("spun", "hand"))
    well = {"failures": [], "hits": [RECOVERED]}
    flights = {
        0: {"with": well, "without": {"spun": {"failures": ["fell"], "hits": [RECOVERED | {"rest_s": None}]}}},
        1: {"with": well, "without": {"spun": {"failures": [], "hits": [RECOVERED | {"past_m": 0.06}]}}},
    }
    lines = table(campaign, Results(flights, {})).splitlines()
    spun = next(line for line in lines if line.startswith("| spun"))
    assert [cell.strip() for cell in spun.split("|")][3:6] == ["2", "+1", "+2"]
    hand = next(line for line in lines if line.startswith("| hand"))
    assert [cell.strip() for cell in hand.split("|")][3:] == ["0", "+0", "+0", *["–"] * 5, ""]
