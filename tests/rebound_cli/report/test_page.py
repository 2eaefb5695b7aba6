"""The page of a flight: whole in one file, its numbers as they were recorded, and safe whatever was heard."""

import base64
import hashlib
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import yaml

import rebound_cli.report
from companion.shell.tlog import read_tlog
from rebound_cli.main import main
from rebound_cli.report.content import NONE, content, kept_rows, packed
from rebound_cli.report.moments import moments_of
from rebound_cli.report.page import SCRIPTS, file_text, page
from rebound_cli.report.shown_flight import recorded_flight
from rebound_cli.report.words import link_rows
from rebound_cli.results.flight_log import read_flight_log
from sim_vehicle.obstacles import WallSpec
from sim_vehicle.truth import TruthRecorder


def unpacked(column):
    """The numbers of a column again, to half the resolution; NaN for none."""
    kind = column["kind"]
    whole = np.frombuffer(base64.b64decode(column["data"]), f"<{kind}").astype(np.float64)
    return np.where(whole == NONE[kind], np.nan, (whole + column["offset"]) * column["resolution"])


class Opened(HTMLParser):
    """`scripts` are those that a browser runs; `tags` all elements in their order, with their attributes."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.scripts, self.styles, self.data = [], [], [], None
        self._open = None
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._open = (tag, dict(attributes).get("type")) if tag in ("script", "style") else None
        if tag == "script" and self._open[1] is None:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self._open = None

    def handle_data(self, text):
        if self._open == ("script", None):
            self.scripts[-1] += text
        elif self._open == ("script", "application/json"):
            self.data = json.loads(text)
        elif self._open is not None and self._open[0] == "style":
            self.styles.append(text)

    def table(self, name):
        return {column: unpacked(data) for column, data in self.data["tables"][name]["columns"].items()}

    def attributes(self, name):
        return [attributes[name] for _, attributes in self.tags if name in attributes]


def test_what_is_not_finite_is_none_and_harms_no_neighbour():
    again = unpacked(packed(np.array([1.0, np.nan, -np.inf, 2.0]), 0.001))
    assert np.isnan(again).tolist() == [False, True, True, False] and np.allclose(again[[0, 3]], [1.0, 2.0])
    # Nor is a number beyond four bytes another one; and a column of nothing is one
    assert np.isnan(unpacked(packed(np.array([0.0, 1e9]), 1e-5))).any()
    assert len(unpacked(packed(np.array([]), 0.1))) == 0


def test_of_a_long_flight_all_round_a_hit_stay_and_the_loudest_of_everything_else():
    # Given 1000 s at 10 Hz, a hit at 500 s, and one loud sample far from it
    seconds, loud = np.linspace(0.0, 999.9, 10_000), np.full(10_000, np.nan)
    loud[1234] = 0.9
    rows = kept_rows(seconds, loud, np.array([500.0]), 1.0, 500)
    assert set(np.flatnonzero(np.abs(seconds - 500.0) <= 1.0)) <= set(rows)
    assert 1234 in rows and len(rows) == 500
    assert (np.diff(rows) > 0).all()
    # and nothing of the flight is left out for long, of a short one nothing at all
    assert np.diff(seconds[rows]).max() < 5.0
    assert len(kept_rows(seconds, loud, np.array([]), 1.0, 10_000)) == 10_000


PACKAGE = Path(rebound_cli.report.__file__).parent / "web"
HOSTILE = "</script><img src=x onerror=alert(1)><script>alert(2)</script><!-- &amp;"


@pytest.fixture(scope="session")
def wall_page(wall_folder):
    return (wall_folder / "report.html").read_text()


@pytest.fixture(scope="session")
def opened(wall_page):
    return Opened(wall_page)


def test_it_is_below_two_megabytes_and_loads_nothing(wall_page, opened):
    assert len(wall_page.encode()) < 2_000_000
    # Given every element that could
    assert opened.attributes("src") == [] and opened.attributes("href") == []
    assert not {"link", "img", "iframe", "object", "embed", "base", "form"} & {tag for tag, _ in opened.tags}
    styles = "".join(opened.styles)
    assert "url(" not in styles and "@import" not in styles
    # and every script of ours
    ours = "".join(map(file_text, SCRIPTS))
    for word in ("http", "fetch(", "XMLHttpRequest", "WebSocket", "EventSource", "import(", "innerHTML", "eval("):
        assert word not in ours, word


def test_a_browser_runs_the_scripts_that_it_names_and_no_others(opened):
    (policy,) = opened.attributes("content")[:1]
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in opened.scripts]
    assert policy.startswith("default-src 'none'; script-src ")
    allowed = policy.partition("script-src ")[2].partition(";")[0].split()
    assert allowed == [f"'sha256-{digest}'" for digest in hashes] and len(allowed) == 7


def test_libraries_are_as_their_makers_publish_them_and_listed_with_their_licences(opened):
    listed = json.loads(file_text("assets/libraries.json"))
    hashes = {name: digest for library in listed for name, digest in library["sha256"].items()}
    found = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (PACKAGE / "assets").iterdir()
        if path.name != "libraries.json"
    }
    assert found == hashes
    in_page = {hashlib.sha256(script.encode()).hexdigest() for script in opened.scripts}
    assert {hashes["three.min.js"], hashes["uPlot.iife.min.js"]} <= in_page
    assert [library["licence"] for library in listed] == ["MIT", "MIT"]
    assert all("Permission is hereby granted" in one["licence_text"] for one in opened.data["libraries"])


def test_what_is_in_it_is_what_was_recorded(wall_folder, opened):
    log = read_flight_log(wall_folder / "flight.tlog")
    imu, path, setpoint = (opened.table(name) for name in ("imu", "path", "setpoint"))
    started_us = log.imu_at_us[0] - round(imu["t"][0] * 1e6)
    assert np.allclose(imu["t"], (log.imu_at_us - started_us) * 1e-6, atol=1e-5)
    assert np.allclose(np.column_stack([imu["fx"], imu["fy"], imu["fz"]]), log.specific_force_frd_m_s2, atol=0.0051)
    assert np.allclose(np.column_stack([imu["p"], imu["q"], imu["r"]]), log.angular_velocity_frd_rad_s, atol=0.00051)
    assert np.allclose(np.column_stack([path["n"], path["e"], path["d"]]), log.position_ned_m, atol=0.00051)
    assert np.allclose(np.column_stack([path["vn"], path["ve"], path["vd"]]), log.velocity_ned_m_s, atol=0.00051)
    places = np.column_stack([setpoint["n"], setpoint["e"], setpoint["d"]])
    assert np.allclose(places, log.setpoint_ned_m, atol=0.00051, equal_nan=True)


def test_it_says_first_what_was_hit_and_a_hit_has_its_place_its_normal_with_its_error_and_its_reasons(
    wall_folder, opened
):
    (hit,) = json.loads((wall_folder / "summary.json").read_text())["collisions"]
    told = opened.data["sentence"]
    assert told.startswith(f"Hit a wall at {hit['impact_speed_m_s']:.2f} ± 0.0")
    assert f"{hit['detected_at_s']:.2f} s into the flight; completed: landed and disarmed." in told
    (moment,) = (moment for moment in opened.data["moments"] if moment["kind"] == "hit")
    assert moment["t"] == hit["detected_at_s"]
    assert np.allclose(moment["normal"], hit["normal_ned"], atol=0.05) and 10.0 < moment["error_deg"] < 20.0
    # The simulator's first touch, before the sample that shows it
    assert moment["touched_ms"] == pytest.approx(-hit["truth"]["detection_latency_ms"], abs=0.001)
    why = "\n".join(moment["reasons"])
    # The sample shows 34 m/s^2, of which the vehicle's turn may have made a part
    assert re.search(
        r"Push sideways: 2\d\.\d m/s², a hit from \d\.\d on \(1\d\.\d times\): speaks for a contact\.", why
    )
    assert "A landing: no" in why and "A person's hand: no" in why and "Verdict: wall, a collision" in why
    # The ground that it landed on is no false alarm
    assert not any("false alarm" in reason for one in opened.data["moments"] for reason in one["reasons"])
    # And what came nearest to a hit, with why it was none
    (moment,) = (moment for moment in opened.data["moments"] if moment["kind"] == "closest")
    assert "Verdict: no hit." in moment["reasons"][-1]
    imu = opened.table("imu")
    row = int(np.argmin(np.abs(imu["boot"] - moment["boot"])))
    assert 0.3 < imu["side"][row] / imu["side_threshold"][row] < 1.0


def test_a_recovery_shows_what_was_wanted_and_flown_until_it_was_handed_over(opened):
    wanted, flown = opened.table("wanted"), opened.table("attitude")
    times_s = {event["kind"]: event["t"] for event in opened.data["events"]}
    # Given a recovery by attitude: its setpoints begin with the hit and end with the hand-over
    assert wanted["t"][0] == pytest.approx(times_s["detection"], abs=0.01)
    assert wanted["t"][-1] == pytest.approx(times_s["hand_over"], abs=0.01)
    # Then the vehicle leans as it was asked to: it follows within a fifth of a second
    lag_s = 0.15
    at_flown = np.interp(wanted["t"] + lag_s, flown["t"], flown["tilt"])
    assert np.corrcoef(at_flown, wanted["tilt"])[0, 1] > 0.5
    # and its own control has the companion's thrust
    target = opened.table("target")
    asked = np.interp(target["t"], wanted["t"], wanted["thrust"])
    during = (target["t"] > wanted["t"][0] + 0.1) & (target["t"] < wanted["t"][-1])
    assert np.abs(asked - target["thrust"])[during].max() < 0.05


def test_the_scene_holds_wall_path_truth_and_what_is_remembered(opened):
    (wall,) = opened.data["obstacles"]
    assert wall["name"] == "north wall" and wall["centre"] == [4.05, 0.0, -1.5] and wall["sizes"] == [0.1, 6.0, 3.0]
    (surface,) = opened.data["surfaces"]
    assert surface["until"] is None and len(surface["corners"]) == 4
    assert abs(np.mean(surface["corners"], axis=0)[0] - 4.0) < 0.1
    assert opened.table("truth")["fold1"].max() > 0.02
    assert [name for _, name in opened.data["modes"]] == ["AUTO.LOITER", "OFFBOARD", "AUTO.LAND", "OFFBOARD"]
    ((began_s, ended_s),) = opened.data["recovering"]
    assert 1.0 < ended_s - began_s < 5.0


def test_the_vehicle_has_the_arms_that_it_flew_with(wall):
    # Given the quad-x that it was, front right first
    arms = np.array(content(wall)["vehicle"]["arms"])
    assert np.allclose(arms, 0.1025 * np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]]), atol=1e-4)
    # and the same flight by six rotors
    places = [(0.0, 0.2), (0.0, -0.2), (0.17, -0.1), (-0.17, 0.1), (0.17, 0.1), (-0.17, -0.1)]
    folds_m = np.zeros((len(wall.truth.series["time_boot_us"]), 6))
    truth = replace(wall.truth, series=wall.truth.series | {"arm_fold_m": folds_m})
    data = content(replace(wall, rotors_frd_m=places, truth=truth))
    assert data["vehicle"]["arms"] == places and "fold6" in data["tables"]["truth"]["columns"]


def test_an_obstacle_that_moves_does_so_by_the_clock_of_the_page(wall):
    # Given a door that comes from 10 s of the vehicle's clock on; the flight's own began some milliseconds later
    door = {"point_ned_m": (3, 0, -1.5), "normal_ned": (-1, 0, 0)}
    moving = WallSpec(**door, motion={"velocity_ned_m_s": (-1.0, 0.0, 0.0), "from_s": 10.0, "until_s": 12.0})
    scene = wall.scene.model_copy(update={"walls": (moving,)})
    (obstacle,) = content(replace(wall, scene=scene))["obstacles"]
    late_s = (wall.started_at_us - wall.truth.epoch_at_boot_us) * 1e-6
    assert 0.0 < late_s < 0.1
    assert obstacle["motion"]["t"] == pytest.approx([10.0 - late_s, 12.0 - late_s])
    assert obstacle["motion"]["offsets"] == ((0.0, 0.0, 0.0), (-2.0, 0.0, 0.0))


def test_nothing_heard_can_become_script(wall):
    # Given a mission, an airframe, an event and a text on the wire that would end the element they are in
    log = replace(wall.log, texts=((wall.started_at_us, HOSTILE),))
    events = [*wall.events, {"time_us": wall.started_at_us, "kind": HOSTILE, "text": f"mode {HOSTILE}", "data": {}}]
    summary = {**wall.summary, "mission": HOSTILE, "airframe": HOSTILE, "reason": HOSTILE, "outcome": "aborted"}
    hostile = Opened(page(replace(wall, name=HOSTILE, log=log, events=events, summary=summary)))
    # Then elements and scripts are those of any page, the title and the policy included
    plain = Opened(page(wall))
    assert [tag for tag, _ in hostile.tags] == [tag for tag, _ in plain.tags]
    assert hostile.scripts == plain.scripts
    assert hostile.attributes("content")[0] == plain.attributes("content")[0]
    # and the texts are there, letter by letter
    assert hostile.data["name"] == HOSTILE and HOSTILE in hostile.data["sentence"]
    told = [(event["kind"], event["text"]) for event in hostile.data["events"]]
    assert ("STATUSTEXT", HOSTILE) in told and (HOSTILE, f"mode {HOSTILE}") in told


def statustext(text, number=0, part=0):
    """A packet of a vehicle's, MAVLink 2."""
    payload = bytes([6]) + text.encode().ljust(50, b"\0") + number.to_bytes(2, "little") + bytes([part])
    return bytes([0xFD, len(payload), 0, 0, 0, 1, 1, 253, 0, 0]) + payload + b"\0\0"


def test_texts_on_the_wire_are_read_whole(tmp_path, wall_folder):
    (at_us, _), *_ = list(read_tlog(wall_folder / "flight.tlog"))
    stamp = at_us.to_bytes(8, "big")
    packets = [statustext("short"), statustext("a" * 50, 7, 0), statustext("and on", 7, 1), statustext("other")]
    (tmp_path / "flight.tlog").write_bytes(b"".join(stamp + packet for packet in packets))
    assert [text for _, text in read_flight_log(tmp_path / "flight.tlog").texts] == [
        "short",
        "a" * 50 + "and on",
        "other",
    ]


def test_without_position_no_place_is_left(wall_folder, tmp_path, capsys):
    out = tmp_path / "shared.html"
    assert main(["report", str(wall_folder), "--no-position", "--out", str(out)]) == 0
    assert f"The report is in {out}" in capsys.readouterr().out
    opened = Opened(out.read_text())
    for table in opened.data["tables"].values():
        assert not {"n", "e", "d"} & set(table["columns"])
    assert opened.data["obstacles"] == [] and opened.data["surfaces"] == []
    assert all(moment["place"] is None for moment in opened.data["moments"])
    # As texts write places: [3.98, 0.04, -1.53]; and the keys of the summary
    texts = [event["text"] for event in opened.data["events"]] + opened.data["lines"]
    assert not [text for text in texts if re.search(r"\[-?\d+\.\d+, ", text)]
    assert any("[left out]" in text for text in texts)
    summary = json.dumps(opened.data["summary"])
    assert "recovery_setpoint_ned_m" not in summary and "touches_ned_m" not in summary
    # What is no place is still there
    assert len(opened.table("imu")["fx"]) > 5000


def test_a_guards_folder_has_one_too(wall_folder, copied):
    # Given what a guard would have heard of the same flight
    for name in ("resolved.yaml", "mission.yaml", "airframe.yaml", "truth.npz", "obstacles.json", "report.html"):
        (copied / name).unlink()
    flown = yaml.safe_load((wall_folder / "resolved.yaml").read_text())
    guarded = {"companion": {"estimate": flown["companion"]["estimate"]}}
    (copied / "guard.yaml").write_text(yaml.safe_dump(guarded))
    (copied / "events.jsonl").write_text("")
    summary = {"outcome": "stopped with Ctrl-C", "collisions": [], "left_alone": 1, "round_trip_ms": {"median": None}}
    (copied / "summary.json").write_text(json.dumps(summary))
    data = Opened(page(recorded_flight(copied))).data
    assert data["sentence"].startswith("Hit a wall at 1.9") and data["sentence"].endswith("stopped with Ctrl-C.")
    assert data["obstacles"] == [] and "truth" not in data["tables"]


def test_a_contact_is_told_of_the_first_hit_in_it_as_the_summary_does(wall_folder):
    flight = recorded_flight(wall_folder)
    (first,) = flight.hits
    again = replace(first, at_us=first.at_us + 60_000)
    flight.findings.impacts.insert(1, again)
    assert flight.contact_of(first) is not None and flight.contact_of(again) is None
    told = {moment.at_us: moment.reasons[-1] for moment in moments_of(flight)}
    assert "a false alarm" in told[again.at_us] and "a false alarm" not in told[first.at_us]


@pytest.mark.parametrize("jump_us", [100e6, -5e6])
def test_a_clock_that_jumps_has_lost_no_samples_and_delayed_none(wall_folder, jump_us):
    flight = recorded_flight(wall_folder)
    told_us = flight.log.imu_time_boot_us + jump_us * (np.arange(len(flight.log.imu_at_us)) > 1000)
    assert link_rows(replace(flight, log=replace(flight.log, imu_time_boot_us=told_us))) == link_rows(flight)


@pytest.mark.parametrize("command", [("report",), ("logs", "export"), ("logs", "export", "--format", "mcap")])
def test_what_is_no_ordinary_file_is_left_as_it_is(wall_folder, tmp_path, capsys, command):
    link = tmp_path / "link"
    link.symlink_to("/dev/null")
    for out in (link, tmp_path):
        assert main([*command, str(wall_folder), "--out", str(out)]) == 1
        assert capsys.readouterr().err == f"rebound: {out} is no ordinary file: give --out another name.\n"
    assert link.is_symlink() and list(tmp_path.iterdir()) == [link]
    # And of a folder that is not there the error names what was typed
    assert main([*command, str(wall_folder), "--out", str(tmp_path / "no" / "page")]) == 1
    assert capsys.readouterr().err.startswith(f"rebound: {tmp_path}/no/page: {tmp_path}/no is no folder")


def truth_of(**series):
    file = io.BytesIO()
    np.savez(file, hits="[]", epoch_at_boot_us=0, **series)
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("truth.npz", b"PK"),
        ("truth.npz", truth_of(time_boot_us=np.zeros(9))),
        ("truth.npz", truth_of(**TruthRecorder().series() | {"attitude_wxyz": np.zeros((1, 4))})),
        ("summary.json", b'{"mission": "wall"}'),
        ("obstacles.json", b"["),
    ],
)
def test_of_a_folder_with_a_damaged_file_there_is_a_sentence(copied, capsys, name, content):
    (copied / name).write_bytes(content)
    assert main(["report", str(copied)]) == 1
    assert re.fullmatch(rf"rebound: .*{name}: .+ the file is damaged\.\n", capsys.readouterr().err)


@pytest.mark.parametrize("content", [b"name: foldable", b"name: [", b"\xff"])
def test_without_a_whole_airframe_the_flight_is_shown_and_it_is_said(copied, content):
    (copied / "airframe.yaml").write_bytes(content)
    with pytest.warns(UserWarning, match="airframe.yaml.*; the flight is shown without it"):
        data = Opened(page(recorded_flight(copied))).data
    assert data["obstacles"] and len(data["vehicle"]["arms"]) == 4


def test_a_flight_that_was_cut_off_has_one_and_one_in_which_nothing_was_heard_has_none(copied, capsys):
    (copied / "summary.json").unlink()
    assert "the recording was cut off" in Opened(page(recorded_flight(copied))).data["sentence"]
    (copied / "flight.tlog").write_bytes(b"")
    (copied / "report.html").unlink()
    assert main(["report", str(copied)]) == 1
    assert "nothing was ever heard in this flight" in capsys.readouterr().err
    assert not (copied / "report.html").exists()
