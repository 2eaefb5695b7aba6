"""A serial line end to end without hardware: two pseudo-terminals, a UART's speed between them, and what it loses."""

import contextlib
import json
import time

import pytest

from companion.mavlink.delivery import Delivery
from companion.shell.tlog import read_tlog
from sim_vehicle.testing import start_vehicle
from tests.rebound_cli.command import (
    HOP,
    SQUARE,
    assert_comes_again,
    events_of,
    guarding,
    run,
    taken_off,
    wait_for_event,
)
from tests.rebound_cli.live.cable import Cable

pytestmark = pytest.mark.realtime


@pytest.fixture
def line(tmp_path):
    """A vehicle at the end of a cable, as `line(baud, loss)`."""
    with contextlib.ExitStack() as stack:

        def laid(baud, loss):
            cable = stack.enter_context(Cable(tmp_path / "pixhawk", baud, loss))
            return cable, stack.enter_context(start_vehicle(links=(cable.vehicle_url,)))

        yield laid


def lost_share(folder):
    """Of the vehicle's packets, by their numbers."""
    delivery = Delivery()
    for _, packet in read_tlog(folder / "flight.tlog"):
        delivery.take(packet, (1, 1))
    return delivery.lost / (delivery.lost + delivery.received)


def texts(folder, kind):
    return [event["text"] for event in events_of(folder) if event["kind"] == kind]


def test_a_guard_waits_for_its_cable_recovers_over_it_and_outlasts_that_it_is_unplugged(line, tmp_path):
    # Given a guard that is up before its cable is plugged in, and a line that loses each tenth packet
    cable, vehicle = line(921_600, 0.1)
    folder = tmp_path / "run"
    with guarding(cable.url, folder, "--wait"):
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
        assert len(texts(folder, "take_over")) == 1
        vehicle.wait_until(lambda truth: truth.mode == "Hold", within_s=5)
        wait_for_event(folder, "mode", word="AUTO.LOITER")
        vehicle.hit(1.5, bearing_deg=90)
        wait_for_event(folder, "given_back", count=2)
        pilot.close()
    summary = json.loads((folder / "summary.json").read_text())
    # What struck it may touch it again before it is clear: part of the same recovery
    assert summary["reconnects"] == 1 and len(summary["collisions"]) >= 2
    assert 0.05 < lost_share(folder) < 0.2
    assert_comes_again(folder)


def test_a_mission_is_flown_over_a_line_that_loses_every_seventh_packet(line, tmp_path):
    cable, _ = line(921_600, 0.15)
    cable.plug()
    # A busy machine keeps the cable from carrying anything for seconds, which is not what is looked at here.
    patient = [word for key in ("", "position_") for word in ("--set", f"companion.link.{key}silence_s=10")]
    done = run("fly", SQUARE, "--connect", cable.url, "--yes", "--out", tmp_path / "run", *HOP, *patient)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 0.08 < lost_share(tmp_path / "run") < 0.25


def test_a_line_that_is_too_slow_for_hits_is_told_and_nothing_is_guarded(line, tmp_path):
    # At a radio's 57 600 baud PX4 sends some 15 samples of its IMU a second
    cable, _ = line(57_600, 0.05)
    cable.plug()
    folder = tmp_path / "run"
    with guarding(cable.url, folder, "--wait"):
        told = wait_for_event(folder, "link", word="not guarded by now")
    assert "HIGHRES_IMU arrives at" in told["text"] and texts(folder, "standing_by") == []
