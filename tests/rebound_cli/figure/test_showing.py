"""Where a page is written by itself after the flight of a real vehicle, and where it is only said how to."""

import io
import shutil
import subprocess
import sys
from queue import Queue
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from rebound_cli.figure import showing
from rebound_cli.live.console import Console
from tests.rebound_cli.command import ROOT
from tests.test_base_install import alone


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def begun(monkeypatch):
    commands = []
    monkeypatch.setattr(showing.subprocess, "Popen", lambda command, **_: commands.append(command))
    return commands


def said(stream, folder, packets=b"some"):
    (folder / "flight.tlog").write_bytes(packets)
    console = Console(stream)
    showing.offer_page(folder, console)
    console.still()
    return stream.getvalue()


def test_a_person_at_a_terminal_gets_it_from_a_process_beside(begun, tmp_path):
    assert "report.html follows." in said(Terminal(), tmp_path)
    assert begun == [[sys.executable, "-m", "rebound_cli.figure.showing", str(tmp_path)]]


def test_a_drone_is_left_alone_and_of_a_flight_in_which_nothing_was_heard_there_is_none(begun, tmp_path, monkeypatch):
    assert said(Terminal(), tmp_path, b"") == ""
    # Given nobody at a terminal, or the base install, which lacks what draws
    assert f"rebound report {tmp_path}" in said(io.StringIO(), tmp_path)
    monkeypatch.setattr(showing, "find_spec", lambda _: None)
    assert f"rebound report {tmp_path}" in said(Terminal(), tmp_path).replace("\n", "")
    assert begun == []


def test_the_base_install_is_enough_to_write_one(wall_flight, tmp_path):
    out = tmp_path / "page.html"
    words = ["report", str(wall_flight[0]), "--out", str(out)]
    done = alone(f"from rebound_cli.main import main\nsys.exit(main({words!r}))", tmp_path)
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 1_000_000


def test_a_process_beside_makes_picture_and_page_whole(wall_flight, tmp_path):
    folder = shutil.copytree(wall_flight[0], tmp_path / "wall")
    for name in ("flight.png", "report.html"):
        (folder / name).unlink()
    done = subprocess.run([sys.executable, "-m", "rebound_cli.figure.showing", str(folder)], cwd=ROOT, check=False)
    assert done.returncode == 0
    assert (folder / "flight.png").read_bytes().endswith(b"IEND\xaeB`\x82")
    assert (folder / "report.html").read_text().rstrip().endswith("</html>")


def test_a_flight_to_watch_is_opened_in_the_browser_until_it_is_over(wall_folder, monkeypatch):
    opened, told = Queue(), io.StringIO()
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(showing.webbrowser, "open", opened.put)
    with showing.watched_page(wall_folder, Console(told), is_to_open=True):
        address = opened.get(timeout=60)
        assert f"Run folder {wall_folder}/; the flight in a browser: {address}" in told.getvalue()
        assert b"<html" in urlopen(address).read()
    with pytest.raises(URLError):
        urlopen(address)
