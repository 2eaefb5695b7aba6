"""A flight's report, or a comparison's, as a person opens it: from a file, without a network, at a desk, on a phone."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from bench.pictures import FRAME_S, write_animation
from rebound_cli.compare import page as compare_page
from rebound_cli.compare.rows import Row
from rebound_cli.report import content as report_content
from rebound_cli.report.page import page, write_page
from tests.browser.opened_page import drawn_share, line_share, pixels
from tests.rebound_cli.command import run_here
from tests.rebound_cli.report.test_page import HOSTILE

_OVERVIEWS = "overviews().map((one) => ({ title: one.title, columns: one.columns() }))"
# Speed and height, place, lean, tilt, thrust, how near to a hit; six of the hit; lateness.
CHART_COUNT = 13
# A line one pixel high across a chart of 113.
LINE = 0.5 / 113


def saved(shown, button):
    with shown.page.expect_download() as waiting:
        shown.page.get_by_role("button", name=button).click()
    return waiting.value.path().read_text()


def test_it_opens_without_a_complaint_and_asks_for_nothing_but_itself(shown, file):
    assert shown.text("#sentence").startswith("Hit a wall at 1.9")
    assert shown.time_s == pytest.approx(11.724, abs=0.01)
    assert shown.asked == [file.as_uri()] and shown.complaints == []


def test_nothing_on_it_is_empty_covers_another_or_leaves_the_window(shown):
    # Given the moment of the hit, at which it opens
    assert drawn_share(shown.scene()) > 0.05
    charts = shown.charts()
    assert len(charts) == CHART_COUNT
    assert [title for title, chart in charts if line_share(chart) < LINE] == []
    # Then each legend stands below its data
    assert shown.overlaps() == []
    assert shown.page.evaluate("document.documentElement.scrollWidth") <= shown.page.viewport_size["width"]


def test_it_leans_as_it_flew_and_each_place_has_the_setpoint_of_its_time(shown, wall):
    columns = {one["title"]: one["columns"] for one in shown.page.evaluate(_OVERVIEWS)}
    # Given a vehicle that pitches nose down to gain speed, and that the wall pushes nose up
    t, roll, pitch = map(np.array, columns["Lean"])
    assert -15.0 < pitch[(t > 8.0) & (t < 10.0)].min() < -5.0 and abs(roll).max() < 10.0
    w, x, y, z = wall.log.attitude_wxyz[row := int(abs(pitch).argmax())]
    assert pitch[row] == pytest.approx(np.degrees(np.arcsin(2 * (w * y - x * z))), abs=0.05)
    # and setpoints 20 to 50 times a second, none before the first
    t, north, asked, *_ = (np.array(one, float) for one in columns["Place and setpoint"])
    is_flown = (t > 9.0) & (t < 11.0)
    assert np.isnan(asked[0]) and abs(north - asked)[is_flown].max() < 0.3


def test_every_moment_is_reached_by_keys_alone(shown, wall):
    moments_s = [moment["t"] for moment in report_content.content(wall)["moments"]]
    assert len(moments_s) > 1
    shown.press("Home")
    assert shown.time_s == 0.0
    for moment_s in moments_s:
        shown.press("n")
        assert shown.time_s == pytest.approx(moment_s, abs=1e-3)
        assert shown.text("#moment-title").startswith(f"{moment_s:.3f} s: ")
    for moment_s in moments_s[-2::-1]:
        shown.press("p")
        assert shown.time_s == pytest.approx(moment_s, abs=1e-3)
    # and by the tab of each, for who cannot see where a key leads
    for tab, moment_s in zip(shown.page.locator("#tabs button").all(), moments_s, strict=True):
        tab.focus()
        shown.press("Enter")
        assert shown.time_s == pytest.approx(moment_s, abs=1e-3) and tab.get_attribute("aria-pressed") == "true"


def test_scrubbing_moves_the_vehicle_the_readout_and_the_clock(shown):
    there = shown.scene(), shown.text("#readout")
    shown.page.locator("#scrubber").fill("5")
    assert shown.time_s == 5.0
    assert shown.text("#readout") != there[1]
    assert (shown.scene() != there[0]).any()
    # and an arrow goes one sample of 4 ms on
    shown.press("ArrowRight")
    assert 0.0 < shown.time_s - 5.0 < 0.01


def test_it_plays_by_its_own_clock_and_ten_times_slower_round_a_hit(opened, file):
    with opened("about:blank") as blank:
        # Given a clock that goes on when it is told to
        blank.page.clock.install(time=0)
        blank.page.goto(file.as_uri())
        blank.page.clock.pause_at(3600)
        blank.page.locator("#scrubber").fill("2")
        blank.press("Space")
        blank.page.clock.run_for(1000)
        assert blank.time_s == pytest.approx(3.0, abs=0.05)
        blank.press("Space")
        blank.page.clock.run_for(1000)
        assert blank.time_s == pytest.approx(3.0, abs=0.05)
        blank.press("n", "n", "Space")
        hit_s = blank.time_s
        blank.page.clock.run_for(1000)
        assert blank.time_s - hit_s == pytest.approx(0.1, abs=0.01)


def test_the_manuals_animation_is_the_replay_from_before_the_hit_to_after_it(browser, file, tmp_path):
    write_animation(browser, file, tmp_path / "hit.webp")
    assert (tmp_path / "hit.webp").stat().st_size < 1_500_000
    with Image.open(tmp_path / "hit.webp") as animation:
        assert animation.info["loop"] == 0 and 2.0 < FRAME_S * animation.n_frames < 4.0
        frames = []
        for number in range(animation.n_frames):
            animation.seek(number)
            frames.append(np.asarray(animation.convert("RGB")).astype(int))
    # Each shows something else than the one before
    assert min(abs(after - before).max() for before, after in pairwise(frames)) > 30


def test_what_was_heard_is_text_and_never_an_element_or_a_script(opened, wall, tmp_path):
    # Given a flight with texts that would be elements where a page took them for such
    log = replace(wall.log, texts=((wall.started_at_us, HOSTILE),))
    file = tmp_path / "hostile.html"
    events = [*wall.events, {"time_us": wall.started_at_us, "kind": HOSTILE, "text": HOSTILE, "data": {}}]
    file.write_text(page(replace(wall, name=HOSTILE, log=log, events=events)))
    with opened(file.as_uri(), width=390) as shown:
        assert shown.text("#name") == HOSTILE
        cells = shown.page.locator("#events td").all_inner_texts()
        assert cells.count(HOSTILE) == 3 and cells.count("STATUSTEXT") > 0
        assert shown.page.locator("img").count() == 0
        assert shown.asked == [file.as_uri()] and shown.complaints == []


def test_a_long_flight_with_its_longer_texts_has_room_on_a_phone(opened, wall, tmp_path, monkeypatch):
    # Given as many rows as are shown of half an hour
    monkeypatch.setattr(report_content, "_ROWS", 1000)
    file = write_page(wall, tmp_path / "long.html")
    with opened(file.as_uri(), width=390) as shown:
        assert "rows: all round the hits, the loudest elsewhere" in shown.text("#downloads")
        assert shown.overlaps() == [] and shown.complaints == []


def test_downloads_hold_all_rows_with_their_units(shown, wall):
    header, *rows = saved(shown, "wall-imu.csv").splitlines()
    assert header.startswith("t [s],boot [s],fx [m/s2]") and len(rows) == len(wall.log.imu_at_us)
    assert json.loads(saved(shown, "wall-summary.json")) == json.loads(json.dumps(wall.summary))


def test_a_mission_that_is_checked_is_shown_before_it_is_flown(opened, tmp_path):
    # Given one in a room, and one whose way is closed
    assert run_here("check", "patrol", "blocked", "--out", tmp_path).returncode == 0
    for name in ("patrol", "blocked"):
        with opened((tmp_path / f"{name}.html").as_uri()) as shown:
            assert drawn_share(shown.scene()) > 0.01 and shown.complaints == []
            there = shown.text("#readout")
            shown.page.locator("#scrubber").fill("8")
            assert shown.text("#readout") != there and "north" in there
            assert [title for title, chart in shown.charts() if line_share(chart) < LINE] == []
            assert not shown.page.locator("#moment-title").is_visible()


def test_without_position_nothing_shows_where_it_was(opened, wall, tmp_path):
    file = tmp_path / "shared.html"
    file.write_text(page(wall, no_position=True))
    with opened(file.as_uri()) as shown:
        assert shown.text("#readout").splitlines()[0] == "recovering, OFFBOARD"
        assert "north" not in shown.text("#readout") and shown.complaints == []
        # The vehicle still turns and folds, where it is drawn
        assert drawn_share(shown.scene()) > 0.01


@pytest.mark.parametrize(
    ("media", "lightness"), [("screen", range(75)), ("print", range(180, 256))], ids=["screen", "paper"]
)
def test_it_is_dark_where_that_is_wanted_and_white_on_paper(opened, file, media, lightness):
    with opened(file.as_uri(), color_scheme="dark") as shown:
        # A browser that prints says so beforehand
        shown.page.emulate_media(media=media)
        shown.page.evaluate(f"window.dispatchEvent(new Event('{'before' if media == 'print' else 'after'}print'))")
        assert round(pixels(shown.page.locator("h1")).mean()) in lightness
        assert [title for title, chart in shown.charts() if line_share(chart) < LINE] == []


def test_each_chart_has_its_points_and_a_point_opens_its_flights_report(opened, tmp_path):
    # Given two laws, two flights each
    rows = [
        Row(law, law, 2.0, seed, f"{law}-{seed}/report.html", "completed", "", 0, 2.0, rest_s + seed, 0.1, 0.5)
        for law, rest_s in (("paper", 5.0), ("adaptive", 1.0))
        for seed in (1, 2)
    ]
    for row in rows:
        (tmp_path / row.report).parent.mkdir()
        (tmp_path / row.report).write_text(f"<title>{row.report}</title>")
    compare_page.write_page(tmp_path / "compare.html", "wall & <racer>", rows)
    with opened((tmp_path / "compare.html").as_uri()) as shown:
        assert shown.text("h1") == "wall & <racer>" and shown.complaints == []
        assert shown.page.locator("svg a").count() == len(rows) * len(compare_page.CHARTS)
        assert shown.page.locator("table tr").count() == 3
        with shown.page.expect_popup() as report:
            shown.page.locator('svg a[*|href="adaptive-2/report.html"]').first.click()
        assert report.value.title() == "adaptive-2/report.html"
