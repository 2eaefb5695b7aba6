"""The items of a mission on the wire: what the vehicle is asked to do, and when the next item comes."""

import itertools
import math

import pytest
from pydantic import ValidationError

from companion.mission.model import Mission
from tests.companion.fake_vehicle import LANDING, LOITER, TAKEOFF, flight
from tests.flying import Flight


def flown(*items, vehicle=None, **changes) -> Flight:
    """The flight over, completed or not."""
    f = flight(vehicle, items=[TAKEOFF, *items, LANDING], **changes)
    f.run_to_end()
    return f


def item_times_s(f: Flight) -> list[float]:
    """How long each item took, take-off left out."""
    times = [event.time_us for event in f.events if event.kind in ("item", "landing")]
    return [(b - a) / 1e6 for a, b in itertools.pairwise(times)]


def setpoints_in(f: Flight, name: str) -> list:
    """Setpoints heard by the vehicle during the item of that name."""
    items = [event for event in f.events if event.kind == "item"]
    index = next(k for k, event in enumerate(items) if event.data["name"] == name)
    start, end = (items[k].time_us - f.now_us + f.vehicle.time_us for k in (index, index + 1))
    return [message for time_us, message in f.vehicle.setpoints if start < time_us <= end]


def test_a_path_is_flown_through_all_its_points():
    points = [[2, 2, -1.5], [6, -1, -1.5], [9, 1, -2.0]]
    f = flown({"path": {"points_ned_m": points, "speed_m_s": 1.0, "yaw_deg": "along"}})
    assert f.report.outcome == "completed"
    asked = setpoints_in(f, "path")
    for point in points:
        assert min(math.dist((m.x, m.y, m.z), point) for m in asked) < 0.02
    assert {m.type_mask for m in asked} <= {0x800, 0x9F8}
    moving = [m for m in asked if math.hypot(m.vx, m.vy) > 0.3]
    behind = [abs(math.remainder(m.yaw - math.atan2(m.vy, m.vx), math.tau)) for m in moving]
    assert sorted(behind)[len(behind) // 2] < math.radians(25), "turns at 45 deg/s to where it flies"


def test_an_orbit_keeps_its_distance_and_looks_at_the_centre():
    f = flown({"orbit": {"centre_ned_m": [2, 0, -1.5], "radius_m": 1.5, "turns": 1.25, "speed_m_s": 1.0}})
    assert f.report.outcome == "completed"
    asked = setpoints_in(f, "orbit")
    on_circle = [m for m in asked if abs(math.hypot(m.x - 2, m.y) - 1.5) < 1e-3]
    assert len(on_circle) * 0.02 == pytest.approx(1.25 * math.tau * 1.5, rel=0.2), "at 1 m/s"
    # onto the circle in the south, and clockwise from there: to the west
    assert min(on_circle[:100], key=lambda m: m.y).y < -0.5
    facing = [abs(math.remainder(m.yaw - math.atan2(-m.y, 2 - m.x), math.tau)) for m in on_circle]
    assert max(facing) < math.radians(5)


def test_a_velocity_is_flown_for_its_time_and_ends_at_rest():
    f = flown({"velocity": {"velocity_ned_m_s": [0, 1, 0], "duration_s": 3.0}})
    assert item_times_s(f)[0] == pytest.approx(3.0, abs=0.03)
    last = f.vehicle.setpoints[-1][1]
    assert (last.x, last.y, last.z) == pytest.approx((0.0, 2.25, -1.5), abs=1e-3), (
        "3 s less half of each ramp, 1 s and 0.5 s"
    )


def test_speed_and_acceleration_can_be_set_for_all_that_follows():
    go = [{"go_to": {"position_ned_m": [2.0 * k, 0, -1.5]}} for k in (1, 0, 1)]
    f = flown(go[0], {"set_speed": {"speed_m_s": 2.0, "acceleration_m_s2": 4.0}}, *go[1:])
    durations = item_times_s(f)
    assert [durations[k] for k in (0, 2, 3)] == pytest.approx([2.75, 2.24, 2.24], abs=0.1), (
        "speeding up with 1 m/s^2 in all of them"
    )


def test_turning_on_the_spot():
    f = flown({"set_yaw": {"yaw_deg": -90, "rate_deg_s": 60}})
    assert item_times_s(f)[0] == pytest.approx(1.5, abs=0.05)
    assert f.vehicle.setpoints[-1][1].yaw == pytest.approx(-math.pi / 2)
    assert f.vehicle.position[:2] == pytest.approx([0, 0], abs=0.01)


def test_waiting_for_a_file():
    f = flight(items=[TAKEOFF, {"wait_for": {"file": "go"}}, LANDING])
    f.run_to("mission")
    f.run_for(5.0)
    assert f.companion.file_awaited == "go" and f.state == "mission"
    f.companion.file_is_there()
    f.run_to("landing", 0.1)
    assert f.companion.file_awaited is None


def test_whoever_is_pushed_is_not_steady():
    f = flight(items=[TAKEOFF, {"wait_for": {"steady": {"for_s": 1.0}}}, LANDING])
    f.run_until(lambda: f.state == "mission" and abs(f.vehicle.velocity[2]) < 0.05)
    f.run_for(0.8)
    assert f.state == "mission"
    f.vehicle.position[1] += 0.4
    f.run_for(0.9)
    assert f.state == "mission", "the second is counted anew"
    f.run_to("landing", 3.0)


@pytest.mark.parametrize(
    ("on_timeout", "mode", "outcome", "north_m"),
    [("abort", LOITER, "aborted", 0.0), ("land", None, "completed", 0.0), ("continue", None, "completed", 1.0)],
)
def test_an_item_that_takes_too_long(on_timeout, mode, outcome, north_m):
    wait = {"wait_for": {"file": "never"}, "timeout_s": 2.0, "on_timeout": on_timeout}
    f = flown(wait, {"go_to": {"position_ned_m": [1, 0, -1.5]}})
    assert f.report.outcome == outcome and "not done within 2 s" in f.event("timeout").text
    assert (f.event("timeout").time_us - f.event("item").time_us) / 1e6 == pytest.approx(2.0, abs=0.02)
    assert f.vehicle.position[0] == pytest.approx(north_m, abs=0.2)
    assert mode is None or f.vehicle.mode == mode


@pytest.mark.parametrize("max_height_m", [6.0, 2.0])
def test_a_mission_can_end_with_the_way_home_below_the_fences_top(max_height_m):
    items = [TAKEOFF, {"go_to": {"position_ned_m": [2, 2, -1.5]}}, {"return": {"height_m": 2.5}}]
    f = flight(items=items, fence={"max_height_m": max_height_m})
    f.run_to("returning")
    f.run_to("landing")
    height_m = min(2.5, max_height_m)
    assert f.vehicle.position == pytest.approx([0.0, 0.0, -height_m], abs=0.4)
    assert min(message.z for _, message in f.vehicle.setpoints) == pytest.approx(-height_m)
    assert f.run_to_end().outcome == "completed"


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ([{"path": {"points_ned_m": []}}], "at least 1 item"),
        ([{"velocity": {"velocity_ned_m_s": [0, 0, 0], "duration_s": 1}}], "not above 0"),
        ([{"set_speed": {"speed_m_s": 6}}], r"item 2 \(set_speed\) flies at 6 m/s, above limits.max_speed_m_s = 5"),
        ([{"velocity": {"velocity_ned_m_s": [0, 4, 4], "duration_s": 1}}], "flies at 5.65685 m/s"),
        ([{"wait_for": {}}], "exactly one condition"),
        ([{"wait_for": {"file": "a", "flight_time_s": 3}}], "exactly one condition"),
        ([{"hold": {"duration_s": 1}, "on_timeout": "land"}], "give timeout_s"),
        ([{"repeat": {"times": 2, "items": [{"land": {}}]}}], "item 2.1 is land"),
        ([{"expect": {"no_collision": {}, "speed": {"max_m_s": 1}}}], "exactly one key"),
        ([{"velocity": {"velocity_ned_m_s": [5, 0, 0], "duration_s": 9}}], r"item 2 \(velocity\) lies"),
        ([{"orbit": {"centre_ned_m": [0, 0, -1.5], "radius_m": 20}}], r"item 2 \(orbit\) lies"),
        ([{"path": {"points_ned_m": [[9, 0, -1.5], [9, 9, -0.1], [9, 12, -1.5]]}}], "below fence.min_height_m"),
    ],
)
def test_items_that_cannot_be_flown(items, words):
    with pytest.raises(ValidationError, match=words):
        Mission.model_validate({"name": "t", "limits": {"max_speed_m_s": 5}, "items": [TAKEOFF, *items, LANDING]})


GO_TO = {"position_ned_m": [2, 0, -1.5]}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wind": 3}, "Extra inputs"),
        ({"items": [TAKEOFF, {"go_to": {**GO_TO, "sped": 3}}, LANDING]}, "Extra inputs"),
        ({"items": [TAKEOFF, {"go_to": {**GO_TO, "speed_m_s": 50}}, LANDING]}, "less than or equal to 12"),
        ({"items": [TAKEOFF, {"go_to": {**GO_TO, "speed_m_s": True}}, LANDING]}, "valid number"),
        ({"items": [TAKEOFF, {"go_to": {"position_ned_m": [1, 2]}}, LANDING]}, "required"),
        ({"items": [TAKEOFF, {"hold": {"duration_s": math.nan}}, LANDING]}, "finite"),
        ({"items": [TAKEOFF, {}, LANDING]}, "exactly one key"),
        ({"items": [TAKEOFF, {"hold": {"duration_s": 1}, **LANDING}, LANDING]}, "exactly one key"),
        ({"items": [LANDING, LANDING]}, "first item must be takeoff"),
        ({"items": [TAKEOFF, {"hold": {"duration_s": 1}}]}, "last item must be land or return"),
        ({"items": [TAKEOFF, LANDING, LANDING]}, "item 2 is land"),
        ({"items": [TAKEOFF, {"go_to": {"position_ned_m": [2, 0, 1.5]}}, LANDING]}, "up is negative"),
        ({"fence": {"max_height_m": 1}}, r"item 1 \(takeoff\) lies .* above fence.max_height_m"),
        ({"on_interrupt": "dance"}, "'hold' or 'land'"),
        ({"companion": {"detector": "magic"}}, "no detector 'magic'"),
        ({"companion": {"fused": {"treshold": 3}}}, "Extra inputs"),
        ({"companion": {"flight": {"setpoint_hz": 5.0}}}, "greater than or equal to 20"),
    ],
)
def test_missions_that_cannot_be_flown(changes, words):
    with pytest.raises(ValidationError, match=words):
        Mission.model_validate({"name": "t", "items": [TAKEOFF, LANDING], **changes})


def test_a_way_that_leaves_a_room_on_its_way_is_refused():
    room = {"polygon_ne_m": [[-2, -2], [6, -2], [6, 1], [2, 1], [2, 6], [-2, 6]]}
    there = [{"go_to": {"position_ned_m": [5, 0, -1.5]}}, {"go_to": {"position_ned_m": [0, 5, -1.5]}}]
    with pytest.raises(ValidationError, match=r"item 3 \(go_to\) leaves fence.polygon_ne_m at \[4.00, 1.00\]"):
        Mission.model_validate({"name": "t", "items": [TAKEOFF, *there, LANDING], "fence": room})
