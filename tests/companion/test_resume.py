"""An interrupted mission taken up again: from which step, from where, and in whose coordinates."""

import pytest

from bench.fly.virtual_time import EPOCH_US
from companion.mission.model import steps_to_fly
from tests.companion.fake_vehicle import FakeVehicle, flight, mission
from tests.flying import Flight

ITEMS = [
    {"takeoff": {"height_m": 1.5}},
    {"set_speed": {"speed_m_s": 2.0}},
    {"go_to": {"position_ned_m": [3, 0, -1.5]}},
    {"repeat": {"times": 2, "items": [{"go_to": {"position_ned_m": [3, y, -1.5]}} for y in (2, 0)]}},
    {"land": {}},
]
FIRST = {"origin_ned_m": [10.0, 5.0, 0.0], "armed_at_us": EPOCH_US - 600_000_000}


def resumed(at_step: int, boot_us: int, items=ITEMS, **changes) -> Flight:
    """The vehicle was armed `boot_us` after its start, ten minutes ago, two metres from where it stands."""
    resume = {"at_step": at_step, **FIRST, "armed_boot_us": boot_us}
    vehicle = FakeVehicle(start_ned_m=(12.0, 5.0, 0.0), time_us=605_000_000)
    return flight(vehicle, items=items, resume=resume | changes)


def test_what_is_left_is_flown_from_where_its_step_begins():
    steps = steps_to_fly(mission(items=ITEMS, resume={"at_step": 4, **FIRST, "armed_boot_us": 0}))
    assert [step.name for step in steps] == ["takeoff", "set_speed", "go_to", "go_to", "go_to", "go_to", "land"]
    assert [step.index for step in steps] == [0, 4, 4, 4, 5, 6, 7]
    # step 4 leads from [3, 2] to [3, 0]
    assert steps[2].action.position_ned_m == (3.0, 2.0, -1.5)
    assert steps[3].label == "4.2 (1 of 2)"


def test_while_the_vehicle_was_not_restarted_its_first_arming_position_counts():
    f = resumed(4, 5_000_000)
    f.run_to("landing")
    assert "the first flight's arming position" in f.event("resume").text
    assert f.report.origin_ned_m == (10.0, 5.0, 0.0)
    climbed = next(m for _, m in f.vehicle.setpoints if m.z < -1.49)
    assert (climbed.x, climbed.y) == pytest.approx((12.0, 5.0), abs=1e-3), "straight up from where it stands"
    assert f.vehicle.position == pytest.approx([13.0, 5.0, -1.5], abs=0.3)
    first = f.event("item", 1)
    assert first.data["step"] == 4 and "go to [3.00, 2.00, -1.50]" in first.text


def test_after_a_restart_the_new_arming_position_counts():
    f = resumed(4, 400_000_000)
    f.run_to("landing")
    assert "the vehicle was restarted" in f.event("resume").text
    assert f.vehicle.position == pytest.approx([15.0, 5.0, -1.5], abs=0.3)


def test_an_interrupted_flight_says_where_to_go_on_and_a_resumed_one_too():
    f = resumed(4, 5_000_000)
    f.run_until(lambda: [e.data["step"] for e in f.events if e.kind == "item"][-1:] == [5])
    f.companion.stop("Ctrl-C")
    f.run_to_end()
    assert f.event("aborted").data["next_step"] == 5


def test_the_hits_of_before_count_for_what_the_mission_expects():
    items = [*ITEMS[:-1], {"expect": {"collisions": {"exactly": 1}}}, ITEMS[-1]]
    f = resumed(6, 5_000_000, items, hits=1)
    f.run_to_end()
    assert f.event("expect").data["met"] is True
    assert f.report.outcome == "completed"
