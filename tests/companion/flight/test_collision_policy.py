"""What a mission does after a hit: its policy, the items' own, and the limit on hits."""

import pytest

from companion.flight.obstacle_map import surroundings
from companion.flight.operator import status_text
from companion.memory.stored import ObstaclesConfig
from companion.reflex.config import EstimateConfig
from tests.companion import fake_vehicle
from tests.companion.fake_vehicle import INTO_WALL, LAND, LANDING, LOITER, TAKEOFF, FakeVehicle, at_wall, flight, strike
from tests.flying import Flight

ASIDE = {"go_to": {"position_ned_m": [0, 2, -1.5], "speed_m_s": 2.0}}


def items_flown(f: Flight) -> list[int]:
    return [event.data["number"] for event in f.events if event.kind == "item"]


@pytest.mark.parametrize(
    ("then", "state", "flown"),
    [("hold", "holding", [2, 3, 4]), ("continue", "mission", [2, 3, 4]), ("land", "landing", [2])],
)
def test_the_interrupted_item_is_left_behind(then, state, flown):
    f = at_wall(INTO_WALL, ASIDE, on_collision={"then": then, "hold_s": 1})
    f.run_to("recovering")
    f.run_until(lambda: f.state != "recovering")
    assert f.state == state
    if then == "hold":
        assert f.run_to("mission") == pytest.approx(1.0, abs=0.02)
    f.run_to_end()
    assert f.report.outcome == "completed" and items_flown(f) == flown


def test_an_item_is_tried_again_slower_each_time_until_the_limit():
    on_collision = {"then": "retry", "retry_speed_factor": 0.7, "max_hits": 3, "after_max_hits": "return"}
    # The way back to the wall is short.
    flying = {"flight": {"speeding_up_m_s2": 2.0}}
    f = at_wall(INTO_WALL, ASIDE, on_collision=on_collision, companion=flying)
    f.run_to_end(200)
    assert items_flown(f) == [2, 2, 2], "the rest of the mission is not flown"
    assert [hit.impact_speed_m_s for hit in f.report.collisions] == pytest.approx([2.0, 1.4, 0.98], rel=0.2)
    assert "at 49% of the speed" in f.event("item", 2).text
    assert "recovery 3 of at most 3; after the recovery: return" in f.event("policy").text
    assert f.report.outcome == "completed" and "not flown from item 2 on" in f.report.reason
    assert f.vehicle.position[:2] == pytest.approx([0, 0], abs=0.3)


def test_what_is_touched_again_while_it_recovers_is_the_same_hit_and_makes_the_next_try_no_slower():
    # Given an item whose own policy counts no hit of the one before
    f = at_wall(
        INTO_WALL, INTO_WALL | {"on_collision": {"then": "retry", "max_hits": 2}}, on_collision={"then": "continue"}
    )
    for state in ("recovering", "mission", "recovering"):
        f.run_to(state)
    f.run_for(0.4)
    strike(f)
    f.run_to("mission")
    assert len(f.report.collisions) == 3 and "policy" not in f.kinds()
    assert "at 50% of the speed" in f.event("item", 2).text
    f.run_to("recovering")
    assert "recovery 2 of at most 2" in f.event("policy").text


def test_a_hit_on_the_way_home_is_recovered_from_and_the_way_goes_on():
    # Whatever the item had to say
    f = at_wall(INTO_WALL | {"on_collision": {"max_hits": 1, "after_max_hits": "return"}})
    f.run_to("returning")
    assert surroundings(f.companion.core.flight).patches == f.report.obstacles != ()
    f.run_for(0.3)
    strike(f)
    assert f.state == "recovering"
    f.run_to("returning")
    f.run_to("landing")
    assert f.vehicle.position[:2] == pytest.approx([0, 0], abs=0.6)
    assert f.run_to_end().outcome == "completed"


def test_the_way_home_may_say_that_a_hit_ends_it():
    f = flight(FakeVehicle(), items=[TAKEOFF, ASIDE, {"return": {}, "on_collision": {"then": "land"}}])
    f.run_to("returning")
    strike(f)
    f.run_to("landing")
    assert f.vehicle.position[1] > 1.0


def test_a_hit_that_is_waited_for_ends_the_waiting_however_items_are_tried_again():
    f = flight(FakeVehicle(), items=[TAKEOFF, {"wait_for": {"hit": True}}, LANDING], on_collision={"then": "retry"})
    f.run_to("mission")
    strike(f)
    assert f.run_to_end().outcome == "completed"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"on_collision": {"max_hits": 1, "after_max_hits": "abort"}}, "of at most 1"),
        ({"abort_when": {"hit_above_m_s": 1.5}}, "hit_above_m_s = 1.5"),
    ],
)
def test_giving_up_hands_the_vehicle_over_once_it_has_settled(changes, words):
    f = at_wall(INTO_WALL, ASIDE, **changes)
    f.run_to("aborted")
    assert "recovered" in f.kinds()
    f.run_to_end()
    assert f.vehicle.mode == LOITER
    assert f.report.outcome == "aborted" and words in f.report.reason


@pytest.mark.parametrize("after_s", [0.0, 0.5], ids=["the land mode is asked for", "it is flown"])
def test_a_landing_is_not_put_off_for_more_hits_than_the_limit(after_s):
    items, abort_when = [{"takeoff": {"height_m": 4}}, LANDING], {"hit_above_m_s": 0.01}
    f = flight(FakeVehicle(), items=items, on_collision={"max_hits": 2}, abort_when=abort_when)
    f.run_to("landing")
    f.run_for(after_s)
    strike(f)
    # Touched again, which is the same hit, and then once more
    f.run_for(0.4)
    assert f.vehicle.mode == fake_vehicle.OFFBOARD
    strike(f)
    f.run_to("landing")
    f.run_for(0.5)
    strike(f)
    f.run_to("recovering", 0.1)
    f.run_to("landing")
    f.run_for(1.5)
    strike(f)
    f.run_for(0.1)
    assert f.state == "landing" and f.vehicle.mode == LAND
    f.run_to_end()
    assert len(f.report.collisions) == 3


def test_a_recovery_keeps_off_what_is_known_behind_it():
    """The gap between two walls is less than the law asks for: the middle is kept, though only one has been touched."""
    slowly = {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 1.0}}
    behind = {"touches_ned_m": [[-0.2, -1, -1.5], [-0.2, 1, -1.5]], "normal_ned": [1, 0, 0], "normal_error_deg": 5}
    norths = []
    for known in ([], [behind]):
        f = flight(FakeVehicle(wall_north_m=0.6), items=[TAKEOFF, slowly, LANDING], obstacles={"known": known})
        f.run_to("recovering")
        f.run_until(lambda f=f: "recovered" in f.kinds())
        norths.append(f.report.collisions[0].recovery_setpoint_ned_m[0])
    middle_m = 0.5 * (0.6 - 0.2 + EstimateConfig().reach_m)
    assert norths[0] < middle_m - 0.04
    assert norths[1] == pytest.approx(middle_m, abs=0.02)


# --- detour: the wall of these flights has no end, the fence leaves 4.2 m of it

ROOM = {"polygon_ne_m": [[-1, -2.1], [8, -2.1], [8, 2.1], [-1, 2.1]], "max_height_m": 2.4}
ROUND = {"then": "detour"}


def in_room(*items, **changes) -> Flight:
    return at_wall(*items, fence=ROOM, **changes)


def test_a_wall_without_an_end_is_given_up_on_after_a_few_places_of_it():
    f = in_room(INTO_WALL, on_collision=ROUND)
    report = f.run_to_end(200)
    assert report.unreachable == ("2",) and len(report.collisions) <= 4
    assert "no way round what is known; then: land" in f.event("unreachable").text
    told = status_text(f.event("unreachable"), "test", 3)
    assert told is not None and told.text.startswith("Item 2 out of reach"), "the operator reads it too"
    assert f.vehicle.position[0] < 3.0 and report.outcome == "completed"
    assert "not flown from item 2 on" in report.reason
    places = [hit.position_ned_m[1] for hit in report.collisions]
    assert all(abs(a - b) > 0.5 for number, a in enumerate(places) for b in places[:number])


@pytest.mark.parametrize(
    ("then", "ends"), [("return", "completed"), ("continue", "completed"), ("abort", "aborted"), ("land", "completed")]
)
def test_what_follows_a_goal_out_of_reach_is_the_missions_to_say(then, ends):
    f = in_room(INTO_WALL, ASIDE, on_collision=ROUND, obstacles={"on_unreachable": then})
    report = f.run_to_end(200)
    assert report.outcome == ends
    assert ("return" in f.kinds()) is (then == "return")
    assert (3 in items_flown(f)) is (then == "continue")
    if then == "abort":
        assert "no way round what is known" in report.reason and f.vehicle.mode == LOITER


def test_ways_are_looked_for_one_a_step_with_a_setpoint_between():
    known = {"touches_ned_m": [[3, -1, -1.5], [3, 1, -1.5]], "normal_ned": [-1, 0, 0]}
    cut_off = {"go_to": {"position_ned_m": [3.05, 0, -1.5]}}
    obstacles = {"known": [known], "on_unreachable": "continue"}
    f = flight(FakeVehicle(), items=[TAKEOFF, *[cut_off] * 6, LANDING], obstacles=obstacles)
    f.run_to("landing")
    assert len({event.time_us for event in f.events if event.kind == "unreachable"}) == 5


@pytest.mark.parametrize("is_hit", [False, True])
def test_a_way_home_that_nobody_planned_keeps_in_a_fence_that_bends(is_hit):
    # Given two arms that are joined in the south, home in one of them and the vehicle in the other
    arms = [[-8, -2], [6, -2], [6, 2], [-4, 2], [-4, 5], [6, 5], [6, 9], [-8, 9]]
    there = [{"go_to": {"position_ned_m": [n, e, -1.5], "speed_m_s": 3}} for n, e in ((-6, 0), (-6, 7), (0, 7))]
    waits = {"wait_for": {"file": "x"}, "timeout_s": 1, "on_timeout": "return"}
    f = flight(
        FakeVehicle(),
        items=[TAKEOFF, *there, waits, LANDING],
        fence={"polygon_ne_m": arms},
        on_collision={"then": "return"},
    )
    f.run_until(lambda: f.companion.core.flight.step_index == 4, 60.0)
    if is_hit:
        strike(f)
    f.run_to_end(120)
    assert f.report.outcome == "completed" and f.vehicle.position[:2] == pytest.approx([0, 0], abs=0.6)


def test_a_way_home_that_is_cut_off_ends_where_it_is():
    known = [{"touches_ned_m": [[1.0, -1.9, -1.5], [1.0, 1.9, -1.5]], "normal_ned": [1, 0, 0]}]
    beside = {"go_to": {"position_ned_m": [2, 0, -1.5], "speed_m_s": 2.0}}
    # Given a wall that is found only behind the vehicle, as a door that has closed
    f = flight(FakeVehicle(), items=[TAKEOFF, beside, {"return": {}}], fence=ROOM, obstacles={"known": []})
    f.run_to("mission")
    f.run_until(lambda: f.vehicle.position[0] > 1.8)
    flown = f.companion.core.flight
    flown.known = flown.mission.model_copy(update={"obstacles": ObstaclesConfig(known=known)}).known
    f.run_to_end(60)
    assert f.report.unreachable == ("home",)
    assert f.vehicle.position[0] == pytest.approx(2.0, abs=0.3)
