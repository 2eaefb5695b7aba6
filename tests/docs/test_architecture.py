"""The architecture names every part of the two programs."""

import re

import pytest

from tests.docs.pages import ROOT

PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("package", ["companion", "sim_vehicle"])
def test_every_folder_and_file_has_its_words(package):
    section = PAGE.split(f"## {package}/\n", 1)[1].split("\n## ", 1)[0]
    # What stands in the first column of the table; of a path its first part.
    cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {name.split("/")[0] for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    there = {path.name for path in (ROOT / package).iterdir() if not path.name.startswith("__")}
    assert named == there
