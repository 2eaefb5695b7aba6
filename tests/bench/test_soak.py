"""The soak's own bookkeeping, and one minute of it by the clock."""

import pytest

from bench.main import main
from bench.studies.soak import WATCHDOG_S, Minute, Systemd, figures


def test_a_watchdog_that_is_fed_too_late_is_counted(tmp_path):
    # Given a service that feeds the watchdog in time and then once too late
    systemd = Systemd(tmp_path / "notify")
    systemd.take(b"STATUS=state connecting\nWATCHDOG=1", 100.5)
    systemd.take(b"READY=1\nWATCHDOG=1", 103.0)
    systemd.take(b"STATUS=state standing by", 104.0)
    systemd.take(b"WATCHDOG=1", 103.1 + WATCHDOG_S)
    assert (systemd.pings, systemd.missed) == (3, 1)
    assert systemd.longest_s == pytest.approx(0.1 + WATCHDOG_S)


def test_the_table_tells_hits_memory_and_what_a_full_disk_took(tmp_path):
    # Given three minutes: a start, an unplugged line, and a full disk that took the record of a hit
    done = [("hit, landing, reboot", 1, None), ("hit, unplugged", 1, 0.8), ("hit, disk full", 0, None)]
    minutes = [
        Minute(what, 1, recorded, again_s, 60_000 + 100 * number, 2.0 + 3.0 * number, 1, 5.0)
        for number, (what, recorded, again_s) in enumerate(done)
    ]
    told = figures(minutes, Systemd(tmp_path / "notify"), [])
    assert told["hits flown, found, in the record"] == "3, 3, 2"
    assert told["the same while the disk was full"] == "1, 1, 0"
    assert told["line unplugged, connected again"] == "1, 1 times"
    # 100 kB a minute; 3 s of a processor in each of two minutes
    assert told["its slope"] == "+6.00 MB an hour" and told["CPU"] == "5.0 % of a core"
    assert told["trouble"] == "none"


@pytest.mark.realtime
def test_a_minute_as_a_service(tmp_path):
    note = tmp_path / "soak.md"
    assert main(["soak", "--minutes", "1", "--folder", str(tmp_path / "disk"), "--out", str(note)]) == 0
    rows = dict(
        [cell.strip() for cell in line.split("|")[1:3]] for line in note.read_text().splitlines() if "|" in line
    )
    assert rows["hits flown, found, in the record"] == "1, 1, 1"
    assert rows["records that decide the same again"] == "1 of 1"
