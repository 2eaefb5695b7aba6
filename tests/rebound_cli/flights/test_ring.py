"""Which flights go when room is short: tried on folders that look like flights, and on a recorder that writes one."""

import contextlib
import errno
import os
from collections import namedtuple

import pytest

from companion.mission.config import DiskConfig
from rebound_cli.background import Background
from rebound_cli.flights import kept as ring
from rebound_cli.flights.kept import LAST_BYTES, LOOK_EVERY_US, Ring, folder_with_room, kept_flights
from rebound_cli.results.run_folder import EVENTS_NAME, TLOG_NAME
from tests.rebound_cli.flights.test_logs import BLOCK, EPOCH_US, pretend, record

GIB, MIB = 1 << 30, 1 << 20
MB = 1_000_000
Usage = namedtuple("Usage", "total used free")
PRESENT = "20260105T000000Z-guard"


def names(runs):
    return [flight.name for flight in kept_flights(runs)]


@pytest.fixture
def disk(monkeypatch):
    """A disk with so much free, of which every removed flight gives back what it took."""

    def of(runs, free):
        at_first = sum(flight.size_bytes for flight in kept_flights(runs))

        def usage(_):
            back = at_first - sum(flight.size_bytes for flight in kept_flights(runs))
            return Usage(100 * GIB, 0, free + back)

        monkeypatch.setattr(ring.shutil, "disk_usage", usage)

    return of


@pytest.mark.parametrize(
    ("config", "disk_bytes", "limits"),
    [
        # A 32 GB card: a tenth of it for flights, and 300 MiB free.
        ({}, 32 * 10**9, (3_200_000_000, 300 * MIB)),
        # On a large disk no more than 4 GiB, on a small one a tenth is left free.
        ({}, 1000 * GIB, (4 * GIB, 300 * MIB)),
        ({}, 1 * GIB, (GIB // 10, GIB // 10)),
        ({"max_use_mb": 500, "keep_free_mb": 50}, GIB, (500 * MB, 50 * MB)),
    ],
)
def test_limits_are_those_of_journald_and_of_px4s_logger_unless_a_person_has_others(config, disk_bytes, limits):
    assert ring.limits_of(DiskConfig.model_validate(config), disk_bytes) == limits


@pytest.mark.parametrize(("lacking_mb", "stay"), [(0, "12345"), (1, "1345"), (2, "135"), (3, "35"), (4, "5"), (5, "5")])
def test_the_oldest_without_a_hit_go_first_those_with_one_last_and_the_present_one_never(
    tmp_path, disk, lacking_mb, stay
):
    # Given five flights of 1 MB, the oldest and the third with a hit
    for day, hits in ((1, 2), (2, 0), (3, 1), (4, 0), (5, 0)):
        present = pretend(tmp_path, f"2026010{day}T000000Z-guard", MB, hits)
    # When so much more is to be left free
    disk(tmp_path, 50 * MB)
    keep_free = {"keep_free_mb": 50 + lacking_mb, "max_use_mb": 1000}
    Ring(present, DiskConfig.model_validate(keep_free)).make_room(EPOCH_US)
    # Then they go in that order, and the present flight stays whatever is asked
    assert "".join(name[7] for name in names(tmp_path)) == stay


def test_the_budget_counts_the_present_flight_as_it_grows(tmp_path, disk):
    # Given a budget of 3 MB and two flights of 1 MB
    for day in (1, 2):
        pretend(tmp_path, f"2026010{day}T000000Z-guard", MB)
    present = pretend(tmp_path, PRESENT, BLOCK)
    disk(tmp_path, 50 * GIB)
    kept = Ring(present, DiskConfig.model_validate({"max_use_mb": 3}))
    kept.make_room(EPOCH_US)
    assert len(names(tmp_path)) == 3
    # When the present one grows to 1.5 MB, nothing happens before it is looked at again
    (present / TLOG_NAME).write_bytes(bytes(1_500_000))
    kept.make_room(EPOCH_US + LOOK_EVERY_US - 1)
    assert len(names(tmp_path)) == 3
    kept.make_room(EPOCH_US + LOOK_EVERY_US)
    # Then the oldest has gone
    assert names(tmp_path) == ["20260102T000000Z-guard", PRESENT]


@pytest.mark.parametrize(
    ("budget_mb", "taken", "free", "is_long"),
    [
        # Of a budget of 160 MB an eighth; with less room than the last 10 MiB there is none for another record.
        (160, 20 * MB - 3 * BLOCK, GIB, False),
        (160, 20 * MB + BLOCK, GIB, True),
        (160, 20 * MB + BLOCK, LAST_BYTES - 1, False),
        # However small the budget, what is less than the last room is not long.
        (0, LAST_BYTES - 2 * BLOCK, GIB, False),
    ],
)
def test_a_record_is_long_when_it_takes_an_eighth_of_the_budget(tmp_path, disk, budget_mb, taken, free, is_long):
    present = pretend(tmp_path, PRESENT, taken)
    disk(tmp_path, free)
    kept = Ring(present, DiskConfig.model_validate({"max_use_mb": budget_mb}))
    with contextlib.suppress(OSError):
        kept.make_room(EPOCH_US)
    assert kept.is_long is is_long


def test_nothing_is_removed_that_is_not_a_flight_of_a_vehicle_which_we_have_named(tmp_path, disk):
    # Given a simulated flight, one that a person has named, a link to one elsewhere, and other folders
    simulated = pretend(tmp_path, "20260101T000000Z-wall", MB)
    (simulated / "airframe.yaml").write_text("name: foldable\n")
    pretend(tmp_path, "first-flight", MB)
    elsewhere = pretend(tmp_path / "archive", "20260101T000000Z-guard", MB)
    (tmp_path / "20260101T000000Z-linked").symlink_to(elsewhere)
    (tmp_path / "20260101T000000Z-notes").mkdir()
    present = pretend(tmp_path, PRESENT, BLOCK)
    before = sorted(path.name for path in tmp_path.iterdir())
    disk(tmp_path, 0)
    # When there is no room at all
    kept = Ring(present, DiskConfig.model_validate({"max_use_mb": 0}))
    with pytest.raises(OSError, match="less than 10 MiB") as caught:
        kept.make_room(EPOCH_US)
    assert caught.value.errno == errno.ENOSPC
    # Then all of them stay
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert (elsewhere / TLOG_NAME).exists()


def test_a_flight_that_another_program_records_stays_until_it_is_closed(tmp_path, disk):
    # Given two flights, of which the older is being recorded
    older = tmp_path / "20260101T000000Z-guard"
    older.mkdir()
    pretend(tmp_path, "20260102T000000Z-guard", MB)
    present = pretend(tmp_path, PRESENT, BLOCK)
    disk(tmp_path, 50 * GIB)
    kept, seen = Ring(present, DiskConfig.model_validate({"max_use_mb": 0})), []

    def make_room(_):
        kept.make_room(EPOCH_US)
        seen.append(names(tmp_path))

    # When nothing may be kept, then that one is, until its recorder is closed
    record(older, 3, make_room=make_room)
    assert seen == [[older.name, PRESENT]] * 3
    kept.make_room(EPOCH_US + LOOK_EVERY_US)
    assert names(tmp_path) == [PRESENT]


def test_a_power_cut_while_one_is_removed_leaves_no_half_of_it(tmp_path, disk, monkeypatch):
    # Given a flight that is to go, and the power that ends before its first file is removed
    pretend(tmp_path, "20260101T000000Z-guard", MB)
    present = pretend(tmp_path, PRESENT, BLOCK)
    disk(tmp_path, 50 * GIB)
    config = DiskConfig.model_validate({"max_use_mb": 0})
    with monkeypatch.context() as during:
        during.setattr(ring.shutil, "rmtree", lambda *_, **__: None)
        Ring(present, config).make_room(EPOCH_US)
    # Then it is no flight any more, and the next program removes the rest
    assert names(tmp_path) == [PRESENT]
    assert len(list(tmp_path.iterdir())) == 2
    Ring(present, config).make_room(EPOCH_US)
    assert [path.name for path in tmp_path.iterdir()] == [PRESENT]


def test_on_a_disk_that_is_as_good_as_full_packets_end_events_go_on_and_it_is_told(tmp_path, disk):
    # Given a flight that begins with too little room, and finds room again after 10 s
    folder = tmp_path / PRESENT
    folder.mkdir()
    disk(tmp_path, LAST_BYTES - 1)
    # When it is recorded
    recorder = record(folder, 50, Background("log"), Ring(folder, DiskConfig()).make_room)
    # Then there is no packet, every event, and one sentence that says why
    assert (folder / TLOG_NAME).stat().st_size == 0
    assert len((folder / EVENTS_NAME).read_text().splitlines()) == len(recorder.events) > 2
    assert recorder.writer.loss.startswith("log has gaps: less than 10 MiB of the disk are free")


def test_a_folder_that_cannot_be_removed_does_not_end_the_flight(tmp_path, disk, monkeypatch):
    # Given two old flights, of which the older is another user's
    pretend(tmp_path, "20260101T000000Z-guard", MB)
    pretend(tmp_path, "20260102T000000Z-guard", MB)
    present = pretend(tmp_path, PRESENT, BLOCK)
    disk(tmp_path, 50 * GIB)
    rename = os.rename

    def refuse(source, target):
        if source.name == "20260101T000000Z-guard":
            raise PermissionError(errno.EPERM, "Operation not permitted")
        rename(source, target)

    monkeypatch.setattr(ring.os, "rename", refuse)
    # When a MB too much is there, then the next one goes
    Ring(present, DiskConfig.model_validate({"max_use_mb": 1.1})).make_room(EPOCH_US)
    assert names(tmp_path) == ["20260101T000000Z-guard", PRESENT]


def test_room_is_made_before_a_flight_has_a_folder(tmp_path, disk, monkeypatch):
    """A service whose disk others had filled could not begin, and guarded nothing, beside flights that may go."""
    # Given two flights of 1 MB, and 50 MB to be left free, of which 1 MB is missing
    monkeypatch.setattr(ring.run_folder, "RUNS_FOLDER", tmp_path)
    for day in (1, 2):
        pretend(tmp_path, f"2026010{day}T000000Z-guard", MB)
    disk(tmp_path, 49 * MB)
    folder, kept = folder_with_room(None, "guard", DiskConfig.model_validate({"keep_free_mb": 50}))
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["20260102T000000Z-guard", folder.name]
    assert kept is not None
    # And where nothing was flown yet there is nothing to do
    monkeypatch.setattr(ring.run_folder, "RUNS_FOLDER", tmp_path / "none")
    folder, _ = folder_with_room(None, "guard", DiskConfig())
    assert folder.is_dir()
    # And beside a folder that a person has named nothing is removed, but packets end there, too
    before = names(tmp_path)
    folder, mine = folder_with_room(tmp_path / "mine", "guard", DiskConfig.model_validate({"max_use_mb": 0}))
    mine.make_room(EPOCH_US)
    disk(tmp_path, LAST_BYTES - 1)
    with pytest.raises(OSError, match="less than 10 MiB"):
        mine.make_room(EPOCH_US + LOOK_EVERY_US)
    assert folder == tmp_path / "mine" and names(tmp_path) == before and not mine.is_long
