"""`rebound watch` beside a flight in real time: a browser sees it, and none disturbs it."""

import json
import re
import time

import psutil
import pytest

from tests.browser.opened_page import drawn_share, line_share
from tests.rebound_cli.command import QUICK, WALL, assert_comes_again, start, wait_for_event

# Only a command that hangs is waited for so long: on a busy machine one that compiles takes minutes.
HANGS_S = 600
# Of one core, while a browser looks: what a companion computer can spare.
MOST_SHARE = 0.05


@pytest.fixture
def flown(tmp_path):
    """A flight that has begun, and its folder."""
    folder = tmp_path / "flight"
    with start("fly", WALL, "--sim", *QUICK, "--json", "--out", folder) as process:
        try:
            wait_for_event(folder, "connected", HANGS_S)
            yield process, folder
        finally:
            process.kill()


@pytest.fixture
def watched(flown):
    """The program that serves its page, and where."""
    with start("watch", flown[1], "--port", "0") as process:
        try:
            yield process, re.search(r"http://127\.0\.0\.1:\d+/", process.stdout.readline())[0]
        finally:
            process.kill()


def cpu_s(process):
    """What it has computed so far."""
    times = psutil.Process(process.pid).cpu_times()
    return times.user + times.system


def wait_for(shown, kind):
    shown.page.get_by_role("cell", name=kind, exact=True).first.wait_for(timeout=1e3 * HANGS_S)


def test_a_flight_is_seen_while_it_is_flown_whoever_vanishes(opened, flown, watched):
    flying, folder = flown
    watch, address = watched
    began_s, computed_s = time.monotonic(), cpu_s(watch)
    with opened(address) as shown:
        # Given a browser that sees it armed, and another that vanishes as it looks
        wait_for(shown, "armed")
        assert flying.poll() is None and shown.text("#h-replay") == "Live"
        with opened(address) as vanishing:
            wait_for(vanishing, "armed")
        wait_for(shown, "done")
        # Then the first one saw all of it, and asked nobody else
        assert (cpu_s(watch) - computed_s) / (time.monotonic() - began_s) < MOST_SHARE
        assert shown.text("#sentence").startswith("done: ") and shown.complaints == []
        assert shown.asked == [address, f"{address}live"]
        assert drawn_share(shown.scene()) > 0.05
        assert [title for title, chart in shown.charts() if line_share(chart) == 0.0] == []
        assert "AUTO.LAND" in shown.text("#legend")
    # and the flight knew of none of them
    summary = json.loads(flying.communicate(timeout=HANGS_S)[0])
    assert flying.returncode == 0 and summary["outcome"] == "completed"
    assert watch.poll() is None
    assert_comes_again(folder)
