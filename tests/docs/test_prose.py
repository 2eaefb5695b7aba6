"""The manual is written in plain English: few words, short sentences, the field's terms."""

import re
import statistics

import pytest

from tests.docs.pages import ROOT, by_hand, manual, name_of
from tests.docs.prose import LONG, lengths, plain

MOST_WORDS = 25_000
MOST_MEAN, MOST_LONG_SHARE = 18.0, 0.08
# A line of the vocabulary: words that are not used, and what the field says instead.
VOCABULARY = [
    tuple(part.strip() for part in line.split("=>"))
    for line in (ROOT / "tests" / "docs" / "vocabulary.txt").read_text(encoding="utf-8").splitlines()
    if "=>" in line
]


def complaints(text):
    prose = "\n".join(line for line in plain(text).splitlines() if line.strip())
    return [
        f"{found[0]!r}: say {instead}"
        for unwanted, instead in VOCABULARY
        for found in re.finditer(rf"\b(?:{unwanted})\b", prose, re.IGNORECASE)
    ]


def test_the_manual_is_short():
    assert sum(len(path.read_text(encoding="utf-8").split()) for path in by_hand()) <= MOST_WORDS


def test_sentences_are_short():
    found = [length for path in by_hand() for length in lengths(path.read_text(encoding="utf-8"))]
    assert len(found) > 500
    assert statistics.mean(found) <= MOST_MEAN
    assert sum(length > LONG for length in found) <= MOST_LONG_SHARE * len(found)


@pytest.mark.parametrize("path", by_hand(), ids=name_of)
def test_a_page_uses_the_words_of_the_field(path):
    if path.name == "glossary.md":
        text = path.read_text(encoding="utf-8").partition("## Words that the code still uses")[0]
    else:
        text = path.read_text(encoding="utf-8")
    assert complaints(text) == []


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_a_page_names_no_place_of_work(path):
    found = re.findall(r"/work/\S+|issue \d+|https?://(?:localhost|127)\S*", path.read_text(encoding="utf-8"))
    assert found == []
