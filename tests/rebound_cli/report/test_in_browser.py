"""The page as a browser shows it, from a file and without a network."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

import rebound_cli.report
from rebound_cli.report.page import LIVE_SCRIPT, SCRIPTS, page
from tests.rebound_cli.report.opened import Opened
from tests.rebound_cli.report.test_page import HOSTILE

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
NODE = shutil.which("node")
# Without background networking: a browser alone asks its maker for updates.
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
)
# Three dimensions without a graphics card.
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


@pytest.mark.skipif(NODE is None, reason="node is not installed: `node --check` reads the scripts")
@pytest.mark.parametrize("name", [*SCRIPTS, LIVE_SCRIPT])
def test_a_script_is_one(name):
    file = Path(rebound_cli.report.__file__).parent / name
    done = subprocess.run([NODE, "--check", file], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def shown(file, tmp_path):
    """What a browser made of the page, and what it logged."""
    command = [CHROMIUM, "--headless", *QUIET, *SOFTWARE, f"--user-data-dir={tmp_path / 'profile'}"]
    command += ["--enable-logging=stderr", "--virtual-time-budget=4000", "--dump-dom", file.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    # A graphics card made of software says that it is slow.
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "GL Driver Message" not in line]
    return done.stdout, said


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium")
def test_the_page_shows_all_of_it_and_runs_nothing_that_was_heard(wall, tmp_path):
    # Given a flight with texts that would be elements where a page took them for such
    log = replace(wall.log, texts=((wall.started_at_us, HOSTILE),))
    file = tmp_path / "flight.html"
    file.write_text(page(replace(wall, name=HOSTILE, log=log)))
    dom, console = shown(file, tmp_path)
    assert console == []
    # Then the sentence and every part are there
    body = Opened(dom)
    assert re.search(r'<h1 id="sentence">Hit a wall at 1\.98 ± 0\.0\d m/s', dom)
    assert re.search(r'id="clock">11\.7\d\d s of 27\.0 s<', dom) and 'aria-pressed="true">11.7 s hit<' in dom
    charts = [
        attributes for tag, attributes in body.tags if tag == "div" and "uplot" in (attributes.get("class") or "")
    ]
    # Two of the flight, six of the hit, one of the link
    assert len(charts) == 9
    assert re.search(r'id="no-scene" hidden=""', dom), "the replay in three dimensions did not begin"
    # and the texts are texts
    assert "&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;" in dom
    assert "img" not in {tag for tag, _ in body.tags}
