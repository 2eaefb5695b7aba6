"""The notes fit on a desk, and what they name is there."""

import re

import pytest

from tests.docs.pages import ROOT

NOTES = ROOT / "bench" / "notes"
DECISIONS = (NOTES / "decisions.md").read_text(encoding="utf-8")
# As `wc -w` counts.
MOST_WORDS = {
    "bench/notes/*.md": 10_000,
    "bench/notes/results.md": 1_500,
    "docs/reference/*.md": 15_000,
    "CHANGELOG.md": 1_000,
}


@pytest.mark.parametrize(("pages", "most"), MOST_WORDS.items())
def test_they_are_short(pages, most):
    found = list(ROOT.glob(pages))
    assert found and sum(len(path.read_text(encoding="utf-8").split()) for path in found) <= most


def test_a_decision_names_numbers_that_the_code_has():
    # And its tables
    paths = (
        path
        for room in ("companion", "sim_vehicle")
        for kind in ("py", "yaml")
        for path in (ROOT / room).rglob(f"*.{kind}")
    )
    code = "\n".join(path.read_text() for path in paths)
    named = set(re.findall(r"`([A-Za-z]\w*_\w+|[A-Z]{4,})`", DECISIONS)) - {"defer_build"}
    assert len(named) > 25
    assert {name for name in named if not re.search(rf"\b{name}\b", code)} == set()


def test_nothing_that_a_study_writes_is_kept():
    assert {path.suffix for path in NOTES.rglob("*.*")} == {".md"}
    assert not [path.name for path in NOTES.glob("*.md") if "<!-- generated" in path.read_text(encoding="utf-8")]
