"""Pages while a flight grows and after it: who asks is answered; and listening to the detector changes nothing."""

import http.client
import io
import json
import random
import socket
import threading
from contextlib import closing, contextmanager
from dataclasses import replace
from queue import Queue
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import pytest

from companion.errors import ReboundError
from companion.messages import Attitude, ExtendedState, ImuSample, LandedState, LocalPosition
from companion.mission.config import CompanionConfig
from rebound_cli.live.console import Console
from rebound_cli.logs.log import LoggedSample
from rebound_cli.replay.report import replay_log, report_text
from rebound_cli.replay.watching import Findings
from rebound_cli.report import showing
from rebound_cli.report.content import content
from rebound_cli.report.live_server import WatchServer
from rebound_cli.report.moments import moments_of
from rebound_cli.report.page import page
from rebound_cli.report.shown_flight import replayed_flight
from rebound_cli.report.tail import COLUMNS, Tail
from rebound_cli.results.flight_log import read_flight_log
from tests.rebound_cli.replay.flying import HIT_US, beat, flight
from tests.rebound_cli.report.test_page import Opened
from tests.test_structure import alone

PATIENCE_S = 60.0


def all_of(tail):
    """Rows of each table and the events, until nothing more comes."""
    rows, events = {name: [] for name in COLUMNS}, []
    while (chunk := tail.read()) is not None:
        for name in COLUMNS:
            rows[name] += chunk["rows"][name]
        events += chunk["events"]
    return rows, events


@pytest.fixture(scope="module")
def whole(wall_folder):
    return all_of(Tail(wall_folder))


def test_ten_rows_a_second_tell_where_the_vehicle_was_and_events_come_as_they_are_written(wall_folder, whole):
    rows, events = whole
    log = read_flight_log(wall_folder / "flight.tlog")
    path = np.array(rows["path"])
    assert np.diff(path[:, 0]).min() >= 0.1 and np.diff(path[:, 0]).max() < 0.15
    shown = np.searchsorted(log.position_at_us, log.position_at_us[0] + (path[:, 0] - path[0, 0]) * 1e6 - 1.0)
    assert np.allclose(path[:, 1:4], log.position_ned_m[shown], atol=1e-4)
    # and no peak between two rows is lost
    peak = np.hypot(*log.specific_force_frd_m_s2[:, :2].T).max()
    assert max(row[1] for row in rows["force"]) == pytest.approx(peak, abs=1e-4)
    written = [json.loads(line) for line in (wall_folder / "events.jsonl").read_text().splitlines()]
    assert [(event["kind"], event["text"]) for event in events] == [(one["kind"], one["text"]) for one in written]
    (hit,) = [event for event in events if event["kind"] == "detection"]
    (moment,) = json.loads((wall_folder / "summary.json").read_text())["collisions"]
    # By the clock of the first packet; the flight's own begins with its first step.
    assert abs(hit["t"] - moment["detected_at_s"]) < 0.1


def test_files_that_grow_by_any_number_of_bytes_tell_the_same(wall_folder, whole, tmp_path):
    # Given packets and lines that are cut anywhere
    tail, path, force, events = Tail(tmp_path), [], [], []
    assert tail.read() is None
    contents = {name: (wall_folder / name).read_bytes() for name in ("flight.tlog", "events.jsonl")}
    for share in (0.0003, 0.1, 0.33, 0.5, 0.7001, 0.9999, 1.0):
        for name, whole_file in contents.items():
            (tmp_path / name).write_bytes(whole_file[: round(share * len(whole_file))])
        rows, more = all_of(tail)
        path, force, events = path + rows["path"], force + rows["force"], events + more
    expected, told = whole
    assert path == expected["path"] and force == expected["force"] and events == told


@contextmanager
def served(folder):
    server = WatchServer(folder, "127.0.0.1", 0)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join(PATIENCE_S)


def asked(server, path, method="GET", host=None):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=PATIENCE_S)
    connection.request(method, path, headers={} if host is None else {"Host": host})
    return connection.getresponse()


def stream_of(server):
    chunks = []
    with closing(asked(server, "/live")) as answer:
        assert answer.getheader("Content-Type") == "text/event-stream"
        while True:
            line = answer.readline()
            assert line, "the stream has ended"
            if line.startswith(b"data: "):
                chunks.append(json.loads(line.removeprefix(b"data: ")))
                if any(event["kind"] == "done" for event in chunks[-1]["events"]):
                    return chunks


def test_a_browser_gets_the_page_and_all_of_the_flight(wall_folder, whole):
    with served(wall_folder) as server:
        opened = Opened(asked(server, "/").read().decode())
        assert opened.data["live"] and opened.data["obstacles"][0]["name"] == "north wall"
        # It may ask its own server, and nobody else
        assert opened.attributes("content")[0].endswith("; connect-src 'self'")
        assert opened.attributes("src") == [] and opened.attributes("href") == []
        for name, columns in COLUMNS.items():
            assert tuple(opened.data["tables"][name]["columns"]) == columns
        chunks = stream_of(server)
    assert [row for chunk in chunks for row in chunk["rows"]["path"]] == whole[0]["path"]


def test_what_is_none_of_the_pages_business_is_refused(wall_folder):
    with served(wall_folder) as server:
        # A site of somebody's whose name leads to this machine
        assert asked(server, "/", host="evil.example:80").status == 403
        assert asked(server, "/live", host="evil.example").status == 403
        assert asked(server, "/flight.tlog").status == 404
        assert asked(server, "/../summary.json").status == 404
        assert asked(server, "/", method="POST").status == 501
        # A browser leaves port 80 out
        assert {asked(server, "/", host=host).status for host in ("localhost", "localhost:80")} == {200}


def test_an_address_that_cannot_be_had_and_damaged_events_are_a_sentence(copied, capsys):
    (copied / "events.jsonl").write_text("{}\n")
    with served(copied) as server:
        for host in ("127.0.0.1", "a..b"):
            with pytest.raises(ReboundError, match=r"nothing can be served there.*; give another --host or --port"):
                WatchServer(copied, host, server.server_port)
        server.reader.join(5)
    assert capsys.readouterr().err.endswith("events.jsonl:1: not what a flight leaves there; the file is damaged.\n")


def test_browsers_that_do_not_read_or_have_gone_disturb_nobody(wall_folder):
    with served(wall_folder) as server:
        # Given more than any socket holds
        server.told.append(b": " + b"x" * 30_000_000 + b"\n\n")
        lazy = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(5)]
        for client in lazy:
            # Asks, and takes nothing of the answer; every other one is gone at once
            client.sendall(b"GET /live HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n")
        for client in lazy[::2]:
            client.close()
        assert stream_of(server)
        assert stream_of(server)
        for client in lazy:
            client.close()


def test_a_sample_beyond_its_threshold_is_a_hit_and_no_other_is(wall):
    fired = {finding.first.impact.sample_time_boot_us for finding in wall.findings.impacts}
    tested = wall.findings.listener.forces.all()
    beyond = tested.time_boot_us[tested.is_armed & (tested.ratio >= 1.0)]
    # The wall and the touchdown
    assert set(beyond) == fired and len(fired) == 2
    assert wall.findings.listener.shown.keys() == fired


def test_a_simulated_flight_has_its_page(wall, wall_folder):
    assert (wall_folder / "report.html").read_text() == page(wall)


def of_a_log(log):
    return replayed_flight(replay_log(log, CompanionConfig()))


def test_a_log_of_anybodys_has_a_page_too():
    # Given a push of 40 m/s^2 from ahead at 6 s, in flight at 1 m/s
    data = content(of_a_log(flight()))
    (moment,) = (moment for moment in data["moments"] if moment["kind"] == "hit")
    assert abs(moment["t"] - HIT_US * 1e-6) < 0.01
    assert data["sentence"].startswith("Hit ") and "of the flight was watched" in data["sentence"]
    assert data["tables"]["imu"]["rows"] > 2000 and data["modes"][0][1] == "OFFBOARD"


def test_a_hit_between_the_samples_is_told_by_the_velocity_that_shows_it():
    # Given a vehicle that a contact between two samples has slowed from 1 to 0.4 m/s
    log, level, chance, heard = flight(hit_us=None), (1.0, 0.0, 0.0, 0.0), random.Random(1), []
    for one in log.heard:
        if isinstance(one.sample, LocalPosition):
            heard.append(one._replace(sample=Attitude(one.at_us, level)))
            velocity = ((1.0 if one.at_us < HIT_US else 0.4) + chance.gauss(0.0, 0.01), 0.0, 0.0)
            one = one._replace(sample=replace(one.sample, velocity_ned_m_s=velocity))
        heard.append(one)
    shown = of_a_log(log := replace(log, heard=tuple(heard)))
    assert "HIT: wall, seen by velocity jump: " in report_text(replay_log(log, CompanionConfig()))
    (moment,) = (moment for moment in moments_of(shown) if moment.kind == "hit")
    (told,) = (reason for reason in moment.reasons if reason.startswith("Velocity jump: 0.6"))
    assert told.endswith("speaks for a contact.") and not any("Push" in reason for reason in moment.reasons)
    # and what it was compared with is the detector's own
    jumps = shown.findings.listener.velocities.all()
    _, limits_m_s = jumps.signs["jump"]
    assert np.count_nonzero(jumps.ratio > 1.0) == 1 and limits_m_s.min() >= 0.12


def test_a_push_is_told_with_the_innovation_that_the_detector_published():
    replay = replay_log(flight(), CompanionConfig())
    ((tested, _),) = replay.findings.listener.shown.values()
    value, limit = tested.signs["side"]
    assert f"HIT: wall, seen by push sideways: {value:.1f} m/s², a hit from {limit:.1f} on" in report_text(replay)


def test_a_turn_is_told_as_one_and_is_near_to_a_hit():
    # Given a vehicle that turns with 3 rad/s from one sample to the next, and shows no force
    heard, level = [], (1.0, 0.0, 0.0, 0.0)
    for one in flight(hit_us=None).heard:
        if isinstance(one.sample, ImuSample) and one.at_us >= HIT_US:
            one = one._replace(sample=replace(one.sample, angular_velocity_frd_rad_s=(0.0, 0.0, 3.0)))
        if isinstance(one.sample, LocalPosition):
            heard.append(one._replace(sample=Attitude(one.at_us, level)))
        heard.append(one)
    replay = replay_log(replace(flight(), heard=tuple(heard)), CompanionConfig())
    assert "HIT: wall, seen by turn at once: 3.0 rad/s, a hit from 1.2 on" in report_text(replay)
    # Then the chart of how near it came to a hit reaches that
    ratios = Opened(page(replayed_flight(replay))).table("imu")["ratio"]
    assert np.nanmax(ratios) == pytest.approx(3.0 / 1.2, abs=0.1)


def test_nothing_recovers_from_a_crash():
    # Given a vehicle whose motors stop in the air, and that lies on its back soon after
    log = flight(push_m_s2=60.0)
    killed = [LoggedSample(HIT_US - 100_000, each) for each in (beat(False), ExtendedState(LandedState.ON_GROUND))]
    turned = [LoggedSample(us, Attitude(us, (0.0, 1.0, 0.0, 0.0))) for us in range(HIT_US - 50_000, 10**7, 50_000)]
    shown = of_a_log(replace(log, heard=tuple(sorted((*log.heard, *killed, *turned), key=lambda one: one.at_us))))
    reasons = [reason for moment in moments_of(shown) for reason in moment.reasons if reason.startswith("Verdict")]
    assert "Verdict: crash, nothing to recover from." in reasons


def test_what_the_simulator_knows_and_nobody_saw_is_told_with_why(wall):
    # Given the same flight by a detector that has told nothing
    (off,) = [span for span in wall.findings.off if span.reason == "connect"]
    blind = Findings(off=[replace(off, end_us=wall.started_at_us + 60_000_000)], listener=wall.findings.listener)
    missed = [moment for moment in moments_of(replace(wall, findings=blind)) if moment.kind == "missed"]
    assert len(missed) == 1 and "a wall at 1.96 m/s" in missed[0].title
    assert missed[0].reasons[0] == "The detector was off: connect."


def test_a_hit_that_nothing_bore_out_is_no_hit_of_the_sentence(wall):
    (hit,) = wall.findings.collisions
    event = {"time_us": hit.at_us + 150_000, "kind": "unconfirmed", "text": "not a hit", "data": {"count": 1}}
    shown = replace(wall, events=[*wall.events, event])
    (moment,) = [moment for moment in moments_of(shown) if moment.kind == "hit"]
    assert "Taken back 150 ms later: nothing else bore it out." in moment.reasons
    assert content(shown)["sentence"].startswith("No hit; ")


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
    done = alone(f"from rebound_cli.main import main\nsys.exit(main({words!r}))")
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
