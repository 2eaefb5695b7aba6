"""A live page: what it reads of a folder that grows, and how it answers browsers of every kind."""

import http.client
import json
import socket
import threading
from contextlib import closing, contextmanager

import numpy as np
import pytest

from rebound_cli.report.live_server import WatchServer
from rebound_cli.report.tail import COLUMNS, Tail
from rebound_cli.results.flight_log import read_flight_log
from tests.rebound_cli.report.opened import Opened

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


def test_ten_rows_a_second_tell_where_the_vehicle_was(wall_folder, whole):
    rows, _ = whole
    log = read_flight_log(wall_folder / "flight.tlog")
    path = np.array(rows["path"])
    assert np.diff(path[:, 0]).min() >= 0.1 and np.diff(path[:, 0]).max() < 0.15
    shown = np.searchsorted(log.position_at_us, log.position_at_us[0] + (path[:, 0] - path[0, 0]) * 1e6 - 1.0)
    assert np.allclose(path[:, 1:4], log.position_ned_m[shown], atol=1e-4)
    # and no peak between two rows is lost
    peak = np.hypot(*log.specific_force_frd_m_s2[:, :2].T).max()
    assert max(row[1] for row in rows["force"]) == pytest.approx(peak, abs=1e-4)


def test_events_come_as_they_are_written(wall_folder, whole):
    _, events = whole
    written = [json.loads(line) for line in (wall_folder / "events.jsonl").read_text().splitlines()]
    assert [(event["kind"], event["text"]) for event in events] == [(one["kind"], one["text"]) for one in written]
    (hit,) = [event for event in events if event["kind"] == "detection"]
    (moment,) = json.loads((wall_folder / "summary.json").read_text())["collisions"]
    # By the clock of the first packet; the flight's own begins with its first step.
    assert abs(hit["t"] - moment["detected_at_s"]) < 0.1


def test_files_that_grow_by_any_number_of_bytes_tell_the_same(wall_folder, whole, tmp_path):
    # Given packets and lines that are cut anywhere
    tail, path, attitude, events = Tail(tmp_path), [], [], []
    assert tail.read() is None
    contents = {name: (wall_folder / name).read_bytes() for name in ("flight.tlog", "events.jsonl")}
    for share in (0.0003, 0.1, 0.33, 0.5, 0.7001, 0.9999, 1.0):
        for name, content in contents.items():
            (tmp_path / name).write_bytes(content[: round(share * len(content))])
        rows, more = all_of(tail)
        path, attitude, events = path + rows["path"], attitude + rows["attitude"], events + more
    expected, told = whole
    assert path == expected["path"] and attitude == expected["attitude"] and events == told


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


def stream_until(server, kind):
    """Every chunk of a stream until an event of that kind."""
    chunks = []
    with closing(asked(server, "/live")) as answer:
        assert answer.getheader("Content-Type") == "text/event-stream"
        while True:
            line = answer.readline()
            assert line, "the stream has ended"
            if line.startswith(b"data: "):
                chunks.append(json.loads(line.removeprefix(b"data: ")))
                if any(event["kind"] == kind for event in chunks[-1]["events"]):
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
        chunks = stream_until(server, "done")
    assert [row for chunk in chunks for row in chunk["rows"]["path"]] == whole[0]["path"]


def test_what_is_none_of_the_pages_business_is_refused(wall_folder):
    with served(wall_folder) as server:
        # A site of somebody's whose name leads to this machine
        assert asked(server, "/", host="evil.example:80").status == 403
        assert asked(server, "/live", host="evil.example").status == 403
        assert asked(server, "/flight.tlog").status == 404
        assert asked(server, "/../summary.json").status == 404
        assert asked(server, "/", method="POST").status == 501
        assert asked(server, "/", host=f"localhost:{server.server_port}").status == 200


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
        assert stream_until(server, "done")
        assert stream_until(server, "done")
        for client in lazy:
            client.close()
