"""Every link, path and name that the manual, the notes and the code use leads somewhere."""

import re

import pytest

from tests.docs.pages import ROOT, manual, name_of

NOTES = sorted((ROOT / "bench" / "notes").glob("*.md"))
_LINK = re.compile(r"\[[^]]*\]\((?!https?:)([^)#\s]*)(?:#([^)\s]+))?\)")
# Paths in code font: of the checkout's own folders and files, without a star and without what a reader fills in.
_PATH = re.compile(
    r"`((?:companion|sim_vehicle|rebound_cli|bench|tests|docs|missions|examples|requirements|\.ci)/[\w./-]*)`"
)
_DOCUMENT = re.compile(r"(?<![\w/])((?:docs|bench/notes)/[\w/-]+\.md)(?:#([\w-]+))?")
_PROGRAMS = ("companion", "sim_vehicle", "rebound_cli", "bench", "tests", "examples", "missions")


def anchors(text):
    """As GitHub and MkDocs make them of headings."""
    heads = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S), re.MULTILINE)
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", head).replace("`", "").lower() for head in heads)
    return {re.sub(r"[^\w\- ]", "", head).strip().replace(" ", "-") for head in plain}


def broken(path):
    text = path.read_text(encoding="utf-8")
    prose = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)
    for target, anchor in _LINK.findall(prose):
        there = (path.parent / target).resolve() if target else path
        if not there.exists():
            yield f"{target} does not exist"
        elif anchor and there.suffix == ".md" and anchor not in anchors(there.read_text(encoding="utf-8")):
            yield f"{target} has no heading #{anchor}"


@pytest.mark.parametrize("path", [*manual(), ROOT / "CHANGELOG.md", *NOTES], ids=name_of)
def test_every_link_leads_somewhere(path):
    assert list(broken(path)) == []


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_every_path_in_the_manual_exists(path):
    text = path.read_text(encoding="utf-8")
    assert [named for named in _PATH.findall(text) if not (ROOT / named).exists()] == []


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_every_test_that_the_manual_names_exists(path):
    named = set(re.findall(r"`(test_\w+)`", path.read_text(encoding="utf-8")))
    written = (file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py")) if named else ()
    assert named - {name for text in written for name in re.findall(r"^def (test_\w+)", text, re.MULTILINE)} == set()


def test_every_page_that_the_code_names_exists():
    found = {
        f"{name_of(path)}: {named}"
        for folder in _PROGRAMS
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".yaml", ".json", ".toml")
        for named, anchor in _DOCUMENT.findall(path.read_text(encoding="utf-8"))
        if not (ROOT / named).exists() or (anchor and anchor not in anchors((ROOT / named).read_text(encoding="utf-8")))
    }
    assert found == set()


@pytest.mark.parametrize("package", ["companion", "sim_vehicle"])
def test_the_architecture_has_words_for_every_folder_and_file(package):
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    section = page.split(f"## {package}/\n", 1)[1].split("\n## ", 1)[0]
    # What stands in the first column of the table; of a path its first part.
    cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {name.split("/")[0] for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    assert named == {path.name for path in (ROOT / package).iterdir() if not path.name.startswith("__")}


def terms():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").partition("## Words")[0]
    cells = [re.split(r"\s*\|\s*", line)[1:-1] for line in text.splitlines() if line.startswith("| ")]
    return [[part.strip("`") for part in row] for row in cells[1:]]


def test_the_glossarys_terms_are_in_the_order_of_the_alphabet():
    names = [row[0] for row in terms()]
    assert len(names) > 40 and names == sorted(names)


@pytest.mark.parametrize("row", terms(), ids=lambda row: row[0])
def test_a_name_of_the_glossary_is_in_its_file(row):
    *_, name, file = row
    assert re.search(rf"\b{name}\b", (ROOT / file).read_text(encoding="utf-8"))
