"""A campaign's results are kept for the code that they follow from."""

import importlib

import pytest

from bench.campaign.plan import Campaign
from bench.corpus.command import USES
from bench.corpus.verdict import work_out
from bench.detectors.campaigns import flights_campaign, hands_campaign, hits_campaign
from bench.faults.command import faults_campaign
from bench.import_graph import module_imports
from bench.kills.killed import kills_campaign
from bench.random_missions.campaign import work_out_mission
from bench.recoveries.hits import recoveries_campaign
from tests.rebound_cli.command import ROOT

# The engine, and how a document is written: no result follows from them.
ENGINE = ["bench.campaign", "bench.marked", "bench.processes"]


@pytest.fixture(scope="module")
def imports():
    return module_imports(ROOT)


@pytest.mark.parametrize(
    "campaign",
    [
        Campaign("corpus", {}, (), work_out, USES),
        Campaign("missions", {}, (), work_out_mission),
        faults_campaign(),
        flights_campaign(0.1),
        hands_campaign(1),
        hits_campaign(1),
        kills_campaign(1, 1),
        recoveries_campaign(1),
    ],
    ids=lambda campaign: campaign.name,
)
def test_all_code_that_a_result_follows_from_is_in_the_campaigns_version(campaign, imports):
    # Given all that the campaign's function imports, by whatever way
    reached, left = set(), {campaign.work_out.__module__}
    while left:
        reached |= left
        left = {name for module in left for name in imports.get(module, ())} - reached
    # Then each module lies in a package whose code the version is made of
    packages = [str(importlib.import_module(room).__package__) for room in campaign.rooms] + ENGINE
    assert [name for name in reached if not any(f"{name}.".startswith(f"{package}.") for package in packages)] == []
