"""A picture and a measured figure of the manual name the command that makes them, and the release that they show."""

import re
import shlex

import pytest

import bench.main
from rebound_cli import __version__
from tests.docs.pages import manual, name_of

STAMP = re.compile(r"Measured\s+by\s+`python -m bench ([^`]+)`\s+on\s+version\s+([\w.]*\w)")
IMAGES = re.compile(r"!\[[^]]*\]\([^)]*\.(?:png|webp)\)")


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_what_is_shown_or_measured_is_of_this_release(path):
    # A release with another number is red until its pictures and figures are made anew
    text = path.read_text(encoding="utf-8")
    for command, version in STAMP.findall(text):
        bench.main.build_parser().parse_args(shlex.split(command))
        assert version == __version__, f"run `python -m bench {command}` and write its version"
    assert not re.search(r"Measured\s+by\s+`", STAMP.sub("", text)), "a stamp that says no version"
    sections = re.split(r"^#+ ", text, flags=re.MULTILINE)
    assert [part[:40] for part in sections if IMAGES.search(part) and not STAMP.search(part)] == []
