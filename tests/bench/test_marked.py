"""Documents of which a part is made anew."""

import pytest

from bench.main import main
from bench.marked import MarkedPartError, checked_text, with_part, write_part

DOCUMENT = "# Bumps\n\nprose\n\n<!-- generated: bumps -->\nold\n<!-- end -->\nmore prose\n"


def test_only_what_stands_between_the_marks_is_made_anew(tmp_path):
    path = tmp_path / "bumps.md"
    path.write_text(DOCUMENT)
    write_part(path, "bumps", "new \\1\n")
    assert path.read_text() == DOCUMENT.replace("old\n", "new \\1\n")


def test_a_document_that_is_not_there_begins_with_its_title_and_the_marks(tmp_path):
    for title, head in (("Bumps", "Bumps"), (None, "bumps")):
        path = tmp_path / head / "document.md"
        write_part(path, "bumps", "new\n", title)
        assert path.read_text() == f"# {head}\n\n<!-- generated: bumps -->\nnew\n<!-- end -->\n"


@pytest.mark.parametrize("text", ["# Bumps\n", DOCUMENT.replace("end", "stop"), DOCUMENT + DOCUMENT])
def test_a_document_without_the_one_place_is_refused(text):
    with pytest.raises(MarkedPartError, match="places for the bumps, not one: give it a line `<!-- generated: bumps"):
        with_part(text, "bumps", "new\n")


@pytest.mark.parametrize(
    ("command", "name", "words"),
    [
        ("paper", "paper.md", "has 0 places for the paper results"),
        ("detectors", "detection.md", "has 0 places for the detectors"),
        ("campaign recoveries", "recovery.md", "has 0 places for the recoveries"),
    ],
)
def test_a_command_looks_for_the_place_before_it_flies(tmp_path, capsys, command, name, words):
    path = tmp_path / name
    path.write_text("# Something else\n")
    assert main([*command.split(), "--out", str(path if name == "recovery.md" else tmp_path)]) == 1
    complaint = capsys.readouterr().err
    assert complaint.startswith(f"bench: {path}: ") and words in complaint and complaint.count("\n") == 1


def test_a_document_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "bumps.md"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(MarkedPartError, match="is no text"):
        checked_text(path, "bumps", "Bumps")
    with pytest.raises(MarkedPartError, match="directory"):
        checked_text(tmp_path, "bumps", "Bumps")
