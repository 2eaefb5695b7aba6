"""A campaign's page: one file without a script, every failure with its command, two versions side by side."""

import json
import re
import xml.etree.ElementTree
from html.parser import HTMLParser

import pytest

from bench.campaign.plan import Campaign
from bench.campaign.record import Record
from bench.campaign_report import page as pages
from bench.campaign_report.multiples import FIGURES, multiples_svg
from bench.main import main
from bench.random_missions.campaign import missions_campaign, work_out_mission
from tests.bench.random_missions.test_campaign_command import HIT

HOSTILE = "</td><script>alert(1)</script>"


def record_of(folder, version, missions=5, failing=(), not_flown=(), first_seed=1, hit=HIT):
    """A campaign's file: those of `failing` did not end as they say, in those of `not_flown` something raised."""
    campaign = missions_campaign(missions, first_seed)
    head = {"campaign": "missions", "version": version, "parameters": dict(campaign.parameters)}
    lines = [head]
    for number, case in enumerate(campaign.cases):
        result = {
            "room": HOSTILE,
            "stream_hz": 50,
            "wind_m_s": 3.0,
            "extras": [],
            "detours": 0,
            "unreachable": 0,
            "failures": [["fell", HOSTILE]] if case.seed in failing and case.feed_forward else [],
            "hits": [{**hit, "bearing_deg": 10.0 * case.seed}],
        }
        lines.append({"case": number} | ({"failure": HOSTILE} if case.seed in not_flown else {"result": result}))
    folder.mkdir(exist_ok=True)
    record = folder / "missions-1.jsonl"
    record.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return record


class Opened(HTMLParser):
    """`rows`: the cells of each table's rows; `links`: whatever names a file or an address."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.tags, self.links = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.links += [value for name, value in attributes if name in ("src", "href")]
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


def opened(folder, *arguments):
    out = folder / "page.html"
    assert main(["campaign", "page", *map(str, arguments), "--out", str(out)]) == 0
    return Opened(out.read_text())


def failures(page):
    return {(row[0], row[1]): row for row in page.rows if row and row[0].isdigit()}


def test_every_failure_has_its_seed_its_cause_and_the_command_that_flies_it_again(tmp_path):
    found = failures(opened(tmp_path, record_of(tmp_path, "new", failing=[3], not_flown=[5])))
    assert found["3", "foldable"][4:6] == [f"fell: {HOSTILE}", "python -m bench campaign --only 3"]
    assert found["3", "rigid"][5] == "python -m bench campaign --only 3 --airframe rigid"
    assert found["5", "rigid"][4] == f"could not be flown: {HOSTILE}"
    assert len(found) == 4


@pytest.mark.slow
def test_what_a_record_holds_is_text_and_the_page_needs_nothing_else(tmp_path):
    # Given a record whose texts would be elements and scripts
    page = opened(tmp_path, record_of(tmp_path, "<b>new</b>", failing=[3]))
    assert "script" not in page.tags and "b" not in page.tags
    assert len(page.links) == len(FIGURES) and all(link.startswith("data:image/svg+xml;base64,") for link in page.links)
    assert "<b>new</b>" in (tmp_path / "page.html").read_text().replace("&lt;", "<").replace("&gt;", ">")


@pytest.mark.slow
def test_the_worst_hits_are_named_by_their_seeds(tmp_path):
    # Given a record in which the hit of one mission overshoots most, and another's rests nearest to what it hit
    record = record_of(tmp_path, "new", missions=9)
    lines = [json.loads(line) for line in record.read_text().splitlines()]
    for number, (key, value) in ((2, ("past_m", 0.5)), (5, ("clear_m", 0.1))):
        lines[1 + number]["result"]["hits"][0][key] = value
    record.write_text("".join(json.dumps(line) + "\n" for line in lines))
    rows = opened(tmp_path, record).rows
    (furthest, nearest) = (next(row for row in rows if row[0].startswith(name)) for name in ("Past", "Clear"))
    assert furthest[1:] == ["50.0 cm", "foldable", "2.0 m/s", "20°", "wall", "python -m bench campaign --only 2"]
    assert nearest[1] == "10.0 cm" and nearest[-1] == "python -m bench campaign --only 3 --airframe rigid"


@pytest.mark.slow
def test_two_versions_are_compared_mission_by_mission(tmp_path):
    # Given a version in which seed 3 fails as before, seed 4 newly, and seed 2 no more
    old = record_of(tmp_path / "old", "old", failing=[2, 3])
    page = opened(tmp_path, record_of(tmp_path / "new", "new", failing=[3, 4]), "--against", old)
    changes = {seed: row[6] for (seed, airframe), row in failures(page).items() if airframe == "rigid"}
    assert changes == {"4": "new", "2": "mended", "3": "as before"}
    # the newly failed first, and of each bar what it was before
    assert next(row[0] for row in page.rows if row and row[0].isdigit()) == "4"
    (endings,) = [row for row in page.rows if row and row[0].startswith("rigid: missions that end")]
    assert endings[2] == endings[5] == "60.00 %"


@pytest.mark.slow
def test_a_mission_that_is_no_more_flown_is_not_called_mended(tmp_path):
    old = record_of(tmp_path / "old", "old", missions=6, failing=[6])
    page = opened(tmp_path, record_of(tmp_path / "new", "new"), "--against", old)
    assert {row[6] for row in failures(page).values()} == {"not flown now"}


@pytest.mark.slow
def test_hits_stand_in_the_panel_of_their_airframe_and_speed_at_their_bearing(tmp_path):
    # Given two-metre-a-second hits of five seeds, seen, and one version's in which none was
    seen = pages.read_version(record_of(tmp_path / "new", "new"))
    missed = pages.read_version(record_of(tmp_path / "old", "old", hit={**HIT, "seen": False}))
    svg = multiples_svg("past_m", {"new": seen.missions, "old": missed.missions})
    xml.etree.ElementTree.fromstring(svg)
    # matplotlib's comments name the texts: titles of panels, and the legend
    for text in ("foldable, 1.5 to 2.5 m/s", "rigid, 3.5 to 5.5 m/s", "new", "old: not noticed"):
        assert f">{text}</text>" in svg
    assert ">new: not noticed</text>" not in svg
    assert svg == multiples_svg("past_m", {"new": seen.missions, "old": missed.missions})
    # a marker a hit and one in the legend: of both airframes' five
    panels = svg.split('id="axes_')[1:]
    counts = [len(re.findall(r"<use [^>]*fill: #0072b2", panel)) for panel in panels]
    assert counts == [0, 5, 0, 0, 0, 5, 0, 0] or counts[:7] == [0, 5, 0, 0, 0, 5, 0]


@pytest.mark.slow
def test_a_campaign_that_goes_on_can_be_looked_at(tmp_path):
    # Given a record whose last line is being written
    record = record_of(tmp_path, "new", failing=[3])
    text = record.read_text() + '{"case":12,"resu'
    record.write_text(text)
    assert failures(opened(tmp_path, record))
    assert record.read_text() == text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds no random missions"),
        ('{"campaign": "hits", "version": "1", "parameters": {}}\n', "holds no random missions"),
        ('{"campaign": "missions", "version": "1", "parameters": {"rooms": 3}}\n', "does not know"),
        ("{\n", "damaged in line 1"),
    ],
)
def test_another_file_is_refused_in_a_sentence(tmp_path, capsys, text, words):
    record = tmp_path / "missions-1.jsonl"
    record.write_text(text)
    assert main(["campaign", "page", str(record)]) == 1
    assert words in capsys.readouterr().err and not record.with_suffix(".html").exists()


@pytest.mark.slow
def test_the_newest_record_is_shown_beside_itself(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", "page"]) == 1
    assert "python -m bench campaign" in capsys.readouterr().err
    (tmp_path / "runs").mkdir()
    record = record_of(tmp_path / "runs" / "campaigns", "new")
    assert main(["campaign", "page"]) == 0
    assert record.with_suffix(".html").stat().st_size > 10_000


def test_a_record_is_read_as_it_was_written(tmp_path):
    campaign = Campaign("missions", missions_campaign(1).parameters, missions_campaign(1).cases, work_out_mission)
    record = Record(campaign, tmp_path)
    record.close()
    assert pages.read_version(record.path).name == campaign.version
