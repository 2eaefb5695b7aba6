"""The glossary's names are where it says."""

import re

import pytest

from tests.docs.pages import ROOT


def rows():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").partition("## Words")[0]
    cells = [re.split(r"\s*\|\s*", line)[1:-1] for line in text.splitlines() if line.startswith("| ")]
    return [[part.strip("`") for part in row] for row in cells[1:]]


def test_there_are_terms_in_the_order_of_the_alphabet():
    terms = [row[0] for row in rows()]
    assert len(terms) > 40 and terms == sorted(terms)


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0])
def test_a_name_is_in_its_file(row):
    *_, name, file = row
    assert re.search(rf"\b{name}\b", (ROOT / file).read_text(encoding="utf-8"))
