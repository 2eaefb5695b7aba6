"""What a campaign's version is made of: all code that its rows follow from."""

import importlib
from pathlib import Path

import pytest

from bench.fly.campaign import CODE
from bench.rows.judge import work_out_mission
from bench.studies import kills
from bench.studies.detectors import work_out_hit
from bench.studies.faults import work_out_fault
from bench.studies.hits import work_out_flown
from tests.import_graph import module_imports

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def imports():
    return module_imports(ROOT)


@pytest.mark.parametrize(
    "work_out",
    [work_out_mission, work_out_hit, work_out_flown, work_out_fault, kills.work_out],
    ids=lambda function: function.__module__,
)
def test_all_code_that_a_row_follows_from_is_in_its_version(work_out, imports):
    # Given all that the function's module imports, by whatever way
    reached, left = set(), {work_out.__module__}
    while left:
        reached |= left
        left = {name for module in left for name in imports.get(module, ())} - reached
    # Then each lies in a package whose code the version is made of, or only shows or names what was found
    packages = [str(importlib.import_module(room).__package__) for room in CODE]
    beside = [name for name in reached if not any(f"{name}.".startswith(f"{package}.") for package in packages)]
    assert {*beside} <= {work_out.__module__, "bench", "bench.studies", "bench.studies.study"}
