"""Where a page is written by itself after a flight, and where it is only said how to."""

import io
from queue import Queue
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from rebound_cli.live.console import Console
from rebound_cli.report import showing
from tests.test_base_install import alone


def said(folder, packets):
    (folder / "flight.tlog").write_bytes(packets)
    console = Console(stream := io.StringIO())
    showing.offer_page(folder, console)
    return stream.getvalue()


def test_of_a_real_flight_it_is_said_how_to_make_one_unless_nothing_was_heard(tmp_path):
    assert said(tmp_path, b"some") == f"A page to look at: rebound report {tmp_path}\n"
    assert said(tmp_path, b"") == ""


def test_the_base_install_is_enough_to_write_one(wall_flight, tmp_path):
    out = tmp_path / "page.html"
    words = ["report", str(wall_flight[0]), "--out", str(out)]
    done = alone(f"from rebound_cli.main import main\nsys.exit(main({words!r}))", tmp_path)
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 1_000_000


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
