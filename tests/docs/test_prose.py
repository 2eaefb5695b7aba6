"""The manual is written in plain English: few words, short sentences, the field's terms. The notes fit on a desk."""

import re
import statistics

import pytest

from tests.docs.pages import ROOT, by_hand, manual, name_of

# What is no prose: code, comments, pictures, marks of tables and lists, addresses of links.
_LEFT_OUT = (
    (re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL), "\n\n"),
    (re.compile(r"<!--.*?-->", re.DOTALL), ""),
    (re.compile(r"^    .*$", re.MULTILINE), ""),
    (re.compile(r"^#+ .*$", re.MULTILINE), "\n"),
    (re.compile(r"!\[[^]]*\]\([^)]*\)"), ""),
    (re.compile(r"\[([^]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"`[^`\n]*`"), "`code`"),
)
_ITEM = re.compile(r"^ *(?:[-*]|\d+\.) ", re.MULTILINE)
# A full stop that ends a sentence is followed by a space and a capital, a digit or a quotation.
_END = re.compile(r"(?<=[.!?])\**\s+(?=[\"'(*`]*[A-Z0-9`])|(?<=:)\s*\n\s*\n|\n\s*\n")
MOST_MEAN, MOST_LONG_SHARE, LONG = 18.0, 0.08, 30
# A line of the vocabulary: words that are not used, and what the field says instead.
VOCABULARY = [
    tuple(part.strip() for part in line.split("=>"))
    for line in (ROOT / "tests" / "docs" / "vocabulary.txt").read_text(encoding="utf-8").splitlines()
    if "=>" in line
]
NOTES = ROOT / "bench" / "notes"
DECISIONS = (NOTES / "decisions.md").read_text(encoding="utf-8")
# As `wc -w` counts.
MOST_OF_PAGES = {
    "manual": 25_000,
    "bench/notes/*.md": 10_000,
    "bench/notes/results.md": 1_500,
    "docs/reference/*.md": 15_000,
    "CHANGELOG.md": 1_000,
}


def plain(text):
    """The prose of a page, a row of a table a paragraph a cell."""
    for pattern, instead in _LEFT_OUT:
        text = pattern.sub(instead, text)
    lines = [
        line if not line.startswith("|") else "\n\n".join(re.split(r"(?<!\\)\|", line)) + "\n"
        for line in text.splitlines()
        if not re.fullmatch(r"[|\-: ]+", line)
    ]
    return _ITEM.sub("\n\n", "\n".join(lines))


def lengths(text):
    """Of its sentences, in words. A table's cells are short and would make the mean look better than the prose is."""
    prose = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("|"))
    found = (len(re.findall(r"\w[\w'’.,/%-]*", part)) for part in _END.split(plain(prose)) if part)
    return [words for words in found if words > 1]


def test_sentences_are_short():
    found = [length for path in by_hand() for length in lengths(path.read_text(encoding="utf-8"))]
    assert len(found) > 500
    assert statistics.mean(found) <= MOST_MEAN
    assert sum(length > LONG for length in found) <= MOST_LONG_SHARE * len(found)


@pytest.mark.parametrize("path", by_hand(), ids=name_of)
def test_a_page_uses_the_words_of_the_field(path):
    text = plain(path.read_text(encoding="utf-8").partition("## Words that the code still uses")[0])
    found = {unwanted: re.findall(rf"\b(?:{unwanted})\b", text, re.IGNORECASE) for unwanted, _ in VOCABULARY}
    assert [(found[unwanted], f"say {instead}") for unwanted, instead in VOCABULARY if found[unwanted]] == []


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_a_page_names_no_place_of_work(path):
    found = re.findall(r"/work/\S+|issue \d+|https?://(?:localhost|127)\S*", path.read_text(encoding="utf-8"))
    assert found == []


@pytest.mark.parametrize(("pages", "most"), MOST_OF_PAGES.items())
def test_manual_notes_reference_and_changelog_are_short(pages, most):
    found = by_hand() if pages == "manual" else list(ROOT.glob(pages))
    assert found and sum(len(path.read_text(encoding="utf-8").split()) for path in found) <= most


def test_a_decision_names_numbers_that_the_code_has():
    # And its tables
    files = [path for room in ("companion", "sim_vehicle") for path in (ROOT / room).rglob("*.*")]
    code = "\n".join(path.read_text() for path in files if path.suffix in (".py", ".yaml"))
    named = set(re.findall(r"`([A-Za-z]\w*_\w+|[A-Z]{4,})`", DECISIONS)) - {"defer_build"}
    assert len(named) > 25
    assert {name for name in named if not re.search(rf"\b{name}\b", code)} == set()


def test_nothing_that_a_study_writes_is_kept():
    assert {path.suffix for path in NOTES.rglob("*.*")} == {".md"}
    assert not [path.name for path in NOTES.glob("*.md") if "<!-- generated" in path.read_text(encoding="utf-8")]
