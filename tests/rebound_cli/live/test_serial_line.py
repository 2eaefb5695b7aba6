"""A guard at the end of a serial line, whose cable comes late and is pulled out."""

import json
import time

import pytest

from sim_vehicle.testing import start_vehicle
from tests.rebound_cli.command import assert_comes_again, events_of, guarding, taken_off, wait_for_event
from tests.rebound_cli.live.cable import Cable

pytestmark = pytest.mark.realtime


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
