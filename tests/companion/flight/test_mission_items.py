"""A mission on the wire: each item, when the next one comes, what was expected, and how an interrupted one goes on."""

import itertools
import math

import pytest
from pydantic import ValidationError

from bench.fly.virtual_time import EPOCH_US
from companion.mission.model import Mission, steps_to_fly
from companion.motion.motors import Damage
from tests.companion.fake_vehicle import INTO_WALL, LANDING, LOITER, TAKEOFF, FakeVehicle, at_wall, flight, mission
from tests.flying import Flight


def flown(*items, vehicle=None, **changes) -> Flight:
    f = flight(vehicle, items=[TAKEOFF, *items, LANDING], **changes)
    f.run_to_end()
    return f


def item_times_s(f: Flight) -> list[float]:
    """How long each item took, take-off left out."""
    times = [event.time_us for event in f.events if event.kind in ("item", "landing")]
    return [(b - a) / 1e6 for a, b in itertools.pairwise(times)]


def setpoints_in(f: Flight, name: str) -> list:
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
    # Speeding up with 1 m/s^2 in all of them
    assert [durations[k] for k in (0, 2, 3)] == pytest.approx([2.75, 2.24, 2.24], abs=0.1)


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
    [
        ("abort", LOITER, "aborted", 1.0),
        ("land", None, "completed", 1.0),
        ("return", None, "completed", 0.0),
        ("continue", None, "completed", 2.0),
    ],
)
def test_an_item_that_takes_too_long(on_timeout, mode, outcome, north_m):
    """The heading stays where it is by then."""
    turn = {"set_yaw": {"yaw_deg": 90, "rate_deg_s": 30}, "timeout_s": 2.0, "on_timeout": on_timeout}
    there, further = ({"go_to": {"position_ned_m": [north_m, 0, -1.5]}} for north_m in (1, 2))
    f = flown(there, turn, further)
    assert f.vehicle.setpoints[-1][1].yaw == pytest.approx(math.radians(60), abs=0.05)
    assert f.report.outcome == outcome and "not done within 2 s" in f.event("timeout").text
    assert (f.event("timeout").time_us - f.event("item", 1).time_us) / 1e6 == pytest.approx(2.0, abs=0.02)
    assert f.vehicle.position[0] == pytest.approx(north_m, abs=0.2)
    assert mode is None or f.vehicle.mode == mode


def test_a_climb_is_no_faster_than_any_setpoint_may_be():
    f = flight(items=[{"takeoff": {"height_m": 5}}, LANDING], limits={"max_speed_m_s": 0.2})
    assert f.run_to_end(120).outcome == "completed" and "envelope" not in f.kinds()


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


HOME = {"go_to": {"position_ned_m": [0, 0, -1.5]}}


@pytest.mark.parametrize(
    ("ending", "slows"),
    [
        ([{"return": {}}], True),
        ([{"return": {}}], False),
        ([HOME, {"set_speed": {"speed_m_s": 1}}, {"land": {}}], True),
    ],
)
def test_a_vehicle_that_comes_past_its_goal_does_not_land_before_it_stays_slow_or_seconds_are_over(ending, slows):
    # Given one whose way there is over while it moves, 0.2 m off, so that a second later it is out of reach
    f = flight(items=[TAKEOFF, {"go_to": GO_TO}, *ending])
    f.run_until(lambda: f.companion.core.flight.step_index >= 2)
    vehicle, wanted_m_s = f.vehicle, 0.6

    def move():
        vehicle.position[:2] = [max(0.2, vehicle.position[0] - 0.004), 0.0]
        vehicle.velocity[:2] = [vehicle.velocity[0] + 0.004 * (wanted_m_s - vehicle.velocity[0]), 0.0]

    def is_asked_to_land():
        return any(command.command == 176 and command.param3 == 6 for _, command in vehicle.commands)

    vehicle.move = move
    f.run_to("landing", 10.0)
    f.run_for(1.0)
    # When it is slow for a moment, as one that turns round
    wanted_m_s = 0.0
    f.run_until(lambda: vehicle.velocity[0] < 0.28)
    wanted_m_s = 0.6
    f.run_for(1.5)
    assert not is_asked_to_land()
    wanted_m_s = 0.2 if slows else 0.6
    f.run_until(is_asked_to_land, 2.0 if slows else 4.0)
    assert vehicle.velocity[0] == pytest.approx(0.26 if slows else 0.6, abs=0.05)


@pytest.mark.parametrize("state", ["well", "hurt", "lost"])
def test_who_is_hurt_or_does_not_know_where_it_is_is_asked_to_land_at_once(state):
    # Given one that does not rest at its goal
    f = flight(items=[TAKEOFF, {"go_to": GO_TO}, {"land": {}}])
    f.run_until(lambda: f.companion.core.flight.is_landing)
    velocity = f.vehicle.velocity
    f.vehicle.move = lambda: velocity.__setitem__(0, velocity[0] + 0.02 * (0.6 - velocity[0]))
    if state == "hurt":
        f.companion.core.flight.motors.damage = Damage(1, 0.2, 0.99, False)
    elif state == "lost":
        f.vehicle.no_positions = True
        f.run_for(1.0)
    f.run_for(0.1)
    assert any(command.param3 == 6 for _, command in f.vehicle.commands if command.command == 176) is (state != "well")


GO_TO = {"position_ned_m": [2, 0, -1.5]}
HOLD = {"hold": {"duration_s": 1}}


def between(*items) -> dict:
    return {"items": [TAKEOFF, *items, LANDING], "limits": {"max_speed_m_s": 5}}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (between({"velocity": {"velocity_ned_m_s": [0, 0, 0], "duration_s": 1}}), "not above 0"),
        (
            between({"set_speed": {"speed_m_s": 6}}),
            r"item 2 \(set_speed\) flies at 6 m/s, above limits.max_speed_m_s = 5",
        ),
        (between({"velocity": {"velocity_ned_m_s": [0, 4, 4], "duration_s": 1}}), "flies at 5.65685 m/s"),
        (between({"wait_for": {}}), "exactly one key"),
        (between({"wait_for": {"file": "a", "flight_time_s": 3}}), "exactly one key"),
        (between({"hold": {"duration_s": 1}, "on_timeout": "land"}), "give timeout_s"),
        (between({"repeat": {"times": 2, "items": [{"land": {}}]}}), "item 2.1 is land"),
        (between({"expect": {"no_collision": {}, "height": {"max_m": 1}}}), "exactly one key"),
        (between({"velocity": {"velocity_ned_m_s": [5, 0, 0], "duration_s": 9}}), r"item 2 \(velocity\) lies"),
        (between({"orbit": {"centre_ned_m": [0, 0, -1.5], "radius_m": 20}}), r"item 2 \(orbit\) lies"),
        (between({"path": {"points_ned_m": [[9, 0, -1.5], [9, 9, -0.1], [9, 12, -1.5]]}}), "below fence.min_height_m"),
        (between({"go_to": {**GO_TO, "speed_m_s": 50}}), "less than or equal to 12"),
        (between({"go_to": {**GO_TO, "speed_m_s": True}}), "valid number"),
        (between({"hold": {"duration_s": math.nan}}), "finite"),
        (between({"hold": None}), "exactly one key"),
        (between({**HOLD, **LANDING}), "exactly one key"),
        (between(LANDING), "item 2 is land"),
        (between({"go_to": {"position_ned_m": [2, 0, 1.5]}}), "up is negative"),
        ({"items": [LANDING, LANDING]}, "first item must be takeoff"),
        ({"items": [TAKEOFF, HOLD]}, "last item must be land or return"),
        ({"items": [TAKEOFF, HOLD, {"return": {"speed_m_s": 9}}], "limits": {"max_speed_m_s": 5}}, "flies at 9 m/s"),
        ({"fence": {"max_height_m": 1}}, r"item 1 \(takeoff\) lies .* above fence.max_height_m"),
        ({"companion": {"flight": {"setpoint_hz": 5.0}}}, "greater than or equal to 20"),
    ],
)
def test_missions_that_cannot_be_flown(changes, words):
    with pytest.raises(ValidationError, match=words):
        Mission.model_validate({"name": "t", "items": [TAKEOFF, LANDING], **changes})


def test_a_way_that_leaves_a_room_on_its_way_is_refused_and_one_along_its_edge_is_not():
    room = {"polygon_ne_m": [[-2, -2], [6, -2], [6, 1], [2, 1], [2, 6], [-2, 6]]}
    there = [{"go_to": {"position_ned_m": [n, e, -1.5]}} for n, e in ((6, 0), (6, -2), (2, 1), (5, 0), (0, 5))]
    with pytest.raises(ValidationError, match=r"item 6 \(go_to\) leaves fence.polygon_ne_m at \[4.00, 1.00\]"):
        Mission.model_validate({"name": "t", "items": [TAKEOFF, *there, LANDING], "fence": room})


# Steady when it meets the wall: the accelerometer of a vehicle that stays level does not show how it speeds up.
STEADY = {"flight": {"speeding_up_m_s2": 2.0}}


# (expectation, whether it is met, a piece of what was found), for a flight into a wall at 2 m/s
BEFORE_THE_HIT = [
    ({"collision": {"within_s": 5}}, True, "2.0"),
    ({"collision": {"within_s": 1}}, False, "no hit"),
    ({"collision": {"within_s": 5, "min_speed_m_s": 2.5}}, False, "hit at 2.0"),
    ({"collision": {"within_s": 5, "max_speed_m_s": 2.5}}, True, "2.0"),
    ({"no_collision": None}, False, "hit at"),
    ({"no_collision": {"for_s": 0.5}}, True, "none"),
    ({"no_collision": {"for_s": 60}}, False, "hit at"),
]
AFTER_IT = [
    ({"no_collision": {}}, True, "none until the end"),
    ({"collision": {"within_s": 100}}, False, "none until the end"),
    ({"collisions": {"exactly": 1}}, True, "1"),
    ({"collisions": {"at_least": 2}}, False, "1"),
    ({"collisions": {"at_most": 1}}, True, "1"),
    ({"recovered": None}, True, "settled after"),
    ({"recovered": {"within_s": 0.1}}, False, "settled after"),
    ({"recovered": {"max_overshoot_m": 0.5}}, True, "too far"),
    ({"position": {"ned_m": [1.95, 0, -1.5], "within_m": 0.3}}, True, ""),
    ({"position": {"ned_m": [5, 0, -1.5], "within_m": 0.3}}, False, ""),
    ({"height": {"min_m": 1.3, "max_m": 1.7}}, True, "1.5"),
    ({"height": {"max_m": 1.0}}, False, "1.5"),
    ({"flight_time": {"at_most_s": 5}}, False, " s"),
    ({"flight_time": {"at_most_s": 60}}, True, " s"),
]


def test_each_expectation_is_met_or_not_and_the_flight_goes_on():
    before, after = ([{"expect": wish} for wish, _, _ in wishes] for wishes in (BEFORE_THE_HIT, AFTER_IT))
    f = at_wall(*before, INTO_WALL, *after, companion=STEADY)
    report = f.run_to_end()
    for result, (wish, met, detail) in zip(report.expectations, [*BEFORE_THE_HIT, *AFTER_IT], strict=True):
        assert result.met is met, (wish, result)
        assert detail in result.detail, (wish, result)
    assert report.outcome == "failed"
    assert report.reason.startswith("expectation of item 3 not met: a hit within 1 s (was: no hit), and ")
    assert f.vehicle.landed == 1 and not f.vehicle.armed, "it lands as it would have"


def test_what_was_expected_of_a_flight_that_ended_early_is_told_too():
    later = [{"expect": wish} for wish in ({"collisions": {"exactly": 0}}, {"height": {"min_m": 1}})]
    f = flight(items=[TAKEOFF, {"expect": {"no_collision": {}}}, {"hold": {"duration_s": 9}}, *later, LANDING])
    f.run_to("mission")
    f.run_for(1.0)
    f.companion.stop("Ctrl-C")
    report = f.run_to_end()
    assert report.outcome == "aborted" and report.reason == "Ctrl-C"
    # What is said of the whole flight, too; what is said of a place that it did not come to is not met
    assert [result.met for result in report.expectations] == [True, True, False]


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
    turned = {"set_yaw": {"yaw_deg": 90}}
    items = [TAKEOFF, {"set_speed": {"speed_m_s": 1.0, "acceleration_m_s2": 1.0}}, turned, *ITEMS[1:]]
    steps = steps_to_fly(mission(items=items, resume={"at_step": 6, **FIRST, "armed_boot_us": 0}))
    # The acceleration of the first one still holds, and the heading
    assert [step.item.name for step in steps] == ["takeoff", *["set_speed"] * 2, *["go_to"] * 4, "land"]
    assert [step.index for step in steps] == [0, 6, 6, 6, 6, 7, 8, 9]
    # step 6 leads from [3, 2] to [3, 0]
    assert (steps[3].action.position_ned_m, steps[3].action.yaw_deg) == ((3.0, 2.0, -1.5), 90.0)
    assert steps[4].label == "6.2 (1 of 2)"


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


def test_the_hits_of_before_count_for_what_the_mission_expects():
    items = [*ITEMS[:-1], {"expect": {"collisions": {"exactly": 1}}}, ITEMS[-1]]
    f = resumed(6, 5_000_000, items, hits=1)
    f.run_to_end()
    assert f.event("expect").data["met"] is True
    assert f.report.outcome == "completed"
