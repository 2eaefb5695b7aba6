"""`rebound guard` as a person or a service runs it, also at the end of a serial line that is pulled out."""

import errno
import json
import os
import signal
import threading
import time
from unittest.mock import Mock, patch

import pytest
import yaml
from pymavlink import mavutil

from companion.errors import ReboundError
from companion.guard.config import GuardConfig
from rebound_cli import guard
from rebound_cli.flights import kept
from rebound_cli.guard import run_guard
from rebound_cli.live.realtime import Loop
from rebound_cli.live.status import ask
from rebound_cli.main import build_parser
from rebound_cli.results import run_folder
from sim_vehicle.testing import start_vehicle
from tests.clients.simulator import free_port, simulator
from tests.rebound_cli import command
from tests.rebound_cli.command import assert_comes_again, events_of, guarding, taken_off, wait_for_event
from tests.rebound_cli.live.cable import Cable

pytestmark = pytest.mark.realtime

PATIENT = ("--set", "companion.link.heartbeat_wait_s=30")


@pytest.mark.parametrize("is_named", [False, True])
def test_nobody_there_is_said_once_and_leaves_no_flight_but_what_a_person_has(is_named, tmp_path, monkeypatch):
    # Given a person's file, in a folder that is named or beside those that are not
    monkeypatch.setattr(run_folder, "RUNS_FOLDER", tmp_path / "runs")
    monkeypatch.setattr(kept, "RUNS_FOLDER", tmp_path / "runs")
    (tmp_path / "notes.txt").touch()
    out = ("--out", tmp_path) if is_named else ()
    quick = ("--set", "companion.link.heartbeat_wait_s=0.3")
    # When nobody is there
    done = command.run_here("guard", "--connect", "udpin://127.0.0.1:0", *quick, *out)
    # Then that is said once, and no flight of nobody is left beside the file
    assert done.returncode == 1 and "log in" not in done.stdout
    assert "No HEARTBEAT from an autopilot within 0.3 s" in done.stderr
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["notes.txt"]


def test_a_disk_that_is_full_keeps_no_vehicle_from_being_guarded(tmp_path):
    # Given a disk on which nothing can be written
    with patch(
        "rebound_cli.results.run_folder.write_json", side_effect=OSError(errno.ENOSPC, "No space left on device")
    ):
        quick = ("--set", "companion.link.heartbeat_wait_s=0.3")
        done = command.run_here("guard", "--connect", "udpin://127.0.0.1:0", "--out", tmp_path / "run", *quick)
    # Then it is told, and the vehicle is looked for all the same
    assert f"{tmp_path / 'run'}: not all can be written: no space left on device" in done.stdout
    assert "No HEARTBEAT" in done.stderr


def test_as_a_service_it_watches_until_it_is_told_to_end(tmp_path, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path / "run"))
    with (
        simulator() as vehicle,
        guarding(f"udpin://127.0.0.1:{vehicle.companion_port}", tmp_path, *PATIENT, "--then", "previous") as guard,
    ):
        wait_for_event(tmp_path, "standing_by")
        status = ask(tmp_path / "run" / "status.sock")
    assert status["command"] == "guard" and status["pid"] == guard.pid and status["folder"] == str(tmp_path)
    assert status["age_s"] < 5.0 and status["hits"] == 0
    assert not (tmp_path / "run" / "status.sock").exists()
    assert "standing_by" in guard.said and "stopped by a terminate signal; no hit;" in guard.said
    assert [event["kind"] for event in events_of(tmp_path)][-1] == "stopped"
    assert (tmp_path / "flight.tlog").stat().st_size > 10_000
    assert_comes_again(tmp_path)
    written = GuardConfig.model_validate(yaml.safe_load((tmp_path / "guard.yaml").read_text()))
    assert written.then == "previous"
    assert written.companion.streams.window_s == 0.5


def test_as_the_link_it_passes_what_a_client_asks_and_is_repeated_to_the_bit(tmp_path):
    between = free_port()
    link = ("--between", f"udpin://127.0.0.1:{between}")
    with simulator() as on, guarding(f"udpin://127.0.0.1:{on.companion_port}", tmp_path, *PATIENT, *link):
        client = mavutil.mavlink_connection(f"udpout:127.0.0.1:{between}", source_system=254)
        wait_for_event(tmp_path, "standing_by")
        # A client that asks for a slow stream, which the guard needs fast, for a parameter, and sends a setpoint
        client.mav.heartbeat_send(6, 8, 0, 0, 4)
        client.mav.command_long_send(1, 1, 511, 0, 31, 1_000_000, *[0] * 5)
        assert client.recv_match(type="COMMAND_ACK", blocking=True, timeout=10).result == 0
        # Asked again, as the parameter protocol has it: mavutil loads its dialect at the first packet, and its socket
        # overflows then
        for _ in range(10):
            client.mav.param_request_read_send(1, 1, b"MIS_TAKEOFF_ALT", -1)
            if value := client.recv_match(type="PARAM_VALUE", blocking=True, timeout=2):
                break
        client.mav.set_position_target_local_ned_send(0, 1, 1, 1, 0xDF8, *[0.0] * 11)
        told = [client.recv_match(type="ATTITUDE_QUATERNION", blocking=True, timeout=10) for _ in range(20)]
        client.close()
    assert value.param_id == "MIS_TAKEOFF_ALT"
    # Then the stream is fast again
    assert told[-1].time_boot_ms - told[0].time_boot_ms < 3_000
    assert json.loads((tmp_path / "summary.json").read_text())["kept_out"] == 0
    inputs = [json.loads(line)["kind"] for line in (tmp_path / "inputs.jsonl").read_text().splitlines()]
    assert {"interval", "setpoint"} <= {*inputs}
    assert_comes_again(tmp_path)


def test_a_vehicle_at_rest_fills_one_record_after_the_other_and_one_that_is_armed_a_single_one(
    rebound_vehicle, tmp_path, monkeypatch
):
    """A vehicle that stood on a bench for a day filled the disk with one record, which the ring never removes."""
    # Given records that are long after 100 kB, some seconds, and are looked at each half second
    runs = tmp_path / "runs"
    monkeypatch.setattr(run_folder, "RUNS_FOLDER", runs)
    monkeypatch.setattr(kept, "LAST_BYTES", 100_000)
    monkeypatch.setattr(kept, "LOOK_EVERY_US", 500_000)
    budget = ("--set", "companion.disk.max_use_mb=0.8")
    words = ("guard", "--connect", rebound_vehicle.tcp_address, *budget, *command.QUICK, *PATIENT)
    while_armed = []

    def pilot():
        try:
            # When the vehicle stands for two records, and then flies for as long as two more
            rebound_vehicle.wait_until(lambda _: len(kept.kept_flights(runs)) == 3, within_s=60)
            radio = taken_off(rebound_vehicle)
            flown = kept.kept_flights(runs)[-1].folder
            radio.close()
            rebound_vehicle.wait_until(lambda _: kept.size_of(flown) > 300_000, within_s=60)
            while_armed.append(kept.kept_flights(runs)[-1].folder == flown)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=pilot)
    thread.start()
    # Then the guard goes on from record to record on the ground, and ends in the one that it flew in
    run_guard(build_parser().parse_args(words))
    thread.join()
    assert while_armed == [True]
    *earlier, last = [flight.folder for flight in kept.kept_flights(runs)]
    outcomes = [json.loads((folder / "summary.json").read_text())["outcome"] for folder in (*earlier, last)]
    assert set(outcomes[:-1]) == {"goes on in the next folder"} and "terminate" in outcomes[-1]
    assert [event["kind"] for event in events_of(last)].count("watching") == 1
    for folder in (*earlier, last):
        assert_comes_again(folder)


def test_a_guard_waits_for_its_cable_recovers_over_it_and_outlasts_that_it_is_unplugged(tmp_path):
    # Given a guard that is up before its cable is plugged in
    folder = tmp_path / "run"
    with (
        Cable(tmp_path / "pixhawk") as cable,
        start_vehicle(links=(cable.vehicle_url,)) as vehicle,
        guarding(cable.url, folder, "--wait"),
    ):
        wait_for_event(folder, "link", word=f"Serial port {cable.name} does not exist")
        first = cable.plug()
        wait_for_event(folder, "standing_by")
        # When a pilot flies, by a radio of their own
        pilot = taken_off(vehicle)
        wait_for_event(folder, "watching", word="watching")
        vehicle.hit(1.5, bearing_deg=90)
        # Then a hit is recovered from
        wait_for_event(folder, "given_back")
        # And when the cable is pulled out, and put in as another device, bytes pass again within a second
        cable.unplug()
        wait_for_event(folder, "link", word="lost, reconnecting")
        second, plugged_us = cable.plug(), time.time_ns() // 1000
        assert second != first
        assert wait_for_event(folder, "link", word="connected again")["time_us"] - plugged_us < 1_000_000
        # And nothing was taken over for that; the next hit is recovered from as the first
        assert [event["kind"] for event in events_of(folder)].count("take_over") == 1
        vehicle.wait_until(lambda truth: truth.mode == "Hold", within_s=5)
        wait_for_event(folder, "mode", word="AUTO.LOITER")
        vehicle.hit(1.5, bearing_deg=90)
        wait_for_event(folder, "given_back", count=2)
        pilot.close()
    summary = json.loads((folder / "summary.json").read_text())
    # What struck it may touch it again before it is clear: part of the same recovery
    assert summary["reconnects"] == 1 and len(summary["collisions"]) >= 2
    assert_comes_again(folder)


def test_a_guard_that_has_met_its_vehicle_goes_on_waiting_for_it_and_one_that_is_cut_off_says_so(tmp_path, monkeypatch):
    options = build_parser().parse_args(["guard", "--connect", "udpin://127.0.0.1:0", "--out", str(tmp_path)])
    with monkeypatch.context() as patched:
        patched.setattr(guard, "_recorded", recorded := Mock(side_effect=["", "over"]))
        with pytest.raises(ReboundError, match="Over"):
            run_guard(options)
    assert [call.args[0].companion.link.wait for call in recorded.call_args_list] == [False, True]
    monkeypatch.setattr(Loop, "run", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        run_guard(options)
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "cut off"
