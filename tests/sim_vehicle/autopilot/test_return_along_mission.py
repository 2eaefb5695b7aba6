"""RETURN by RTL_TYPE 1 to 4: which way, past which places, down where."""

import math

import pytest

from sim_vehicle.autopilot.commands import NAV_RETURN_TO_LAUNCH
from sim_vehicle.autopilot.flight_commands import DO_REPOSITION
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionType
from sim_vehicle.autopilot.modes import Mode
from tests.sim_vehicle.autopilot.flying import action, hovering, item, place, set_mode, upload
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

NAN = math.nan
# A takeoff at home, three corners, and a landing far from home with a way of its own.
OUT = (item(kinds.TAKEOFF), item(kinds.WAYPOINT, 30.0, 0.0), item(kinds.WAYPOINT, 30.0, 30.0, 8.0))
IN = (action(kinds.DO_LAND_START), item(kinds.WAYPOINT, 10.0, 45.0), item(kinds.LAND, 0.0, 45.0, 0.0))
WITH_LANDING = (*OUT, *IN)
WITHOUT_LANDING = (*OUT, item(kinds.WAYPOINT, 10.0, 45.0))
LANDING, HOME = (0.0, 45.0), (0.0, 0.0)


def north_east(flight: Flight) -> tuple[float, float]:
    return flight.state.position_ned_m[:2]


def at(north_m: float, east_m: float, mission: tuple, **parameters: float) -> Flight:
    """In hold at a place, with a mission that was not flown."""
    flight = hovering(5.0, RTL_RETURN_ALT=10.0, **parameters)
    upload(flight, *mission)
    flight.ask(DO_REPOSITION, -1, 1, 0, NAN, *place(north_m, east_m), NAN)
    flight.fly_until(lambda: math.dist(north_east(flight), (north_m, east_m)) < 0.5, 40.0)
    flight.autopilot.texts.clear()
    return flight


def passed(flight: Flight) -> list[tuple[float, float, float]]:
    """North, east and height of every target on the way to the ground."""
    assert flight.ask(NAV_RETURN_TO_LAUNCH) is Result.ACCEPTED
    targets: list[tuple[float, float, float]] = []
    for _ in range(120 * 250):
        there = flight.autopilot.navigator.shown_target_ned_m
        if there is not None:
            shown = (round(there[0]), round(there[1]), round(-there[2]))
            if not targets or targets[-1] != shown:
                targets.append(shown)
        flight.step()
        if not flight.autopilot.arming.armed:
            return targets
    raise AssertionError(f"did not land: {targets}")


def landed_at(flight: Flight, where: tuple[float, float]) -> bool:
    return math.dist(north_east(flight), where) < 0.5


@pytest.mark.parametrize(
    ("rtl_type", "north_m", "east_m", "where"),
    [
        # 1: the landing, however near home is; 3: what is nearest; 0: never the landing
        (1, 2.0, 2.0, LANDING),
        (3, 20.0, 40.0, LANDING),
        (3, 2.0, 2.0, HOME),
        (0, 20.0, 40.0, HOME),
    ],
)
def test_which_place_it_returns_to(rtl_type, north_m, east_m, where):
    flight = at(north_m, east_m, WITH_LANDING, RTL_TYPE=rtl_type)
    passed(flight)
    assert landed_at(flight, where)


def test_straight_to_where_the_landing_begins_and_from_there_along_it():
    flight = at(20.0, 20.0, WITH_LANDING, RTL_TYPE=1)
    # Up to 10 m above the landing, to the landing's first place, over the landing at that place's height, and down
    assert passed(flight) == [(20, 20, 10), (10, 45, 5), (0, 45, 5), (0, 45, 0)]
    assert any(text.startswith("RTL Mission land: climb to ") for text in flight.texts())
    assert flight.autopilot.missions.current == 5


def test_a_rally_point_that_is_nearer_is_preferred_to_the_landing():
    flight = at(20.0, 20.0, WITH_LANDING, RTL_TYPE=1)
    upload(flight, item(kinds.RALLY_POINT, 25.0, 15.0, 0.0), kind=MissionType.RALLY)
    passed(flight)
    assert landed_at(flight, (25.0, 15.0))


def test_without_landing_and_rally_point_type_1_returns_home():
    flight = at(20.0, 20.0, WITHOUT_LANDING, RTL_TYPE=1)
    passed(flight)
    assert landed_at(flight, HOME)


def test_on_along_the_mission_from_its_nearest_place_to_the_landing():
    flight = at(28.0, 2.0, WITH_LANDING, RTL_TYPE=2)
    assert passed(flight) == [(30, 0, 5), (30, 30, 8), (10, 45, 5), (0, 45, 5), (0, 45, 0)]


def test_back_along_a_mission_without_landing_to_the_takeoff_and_down_at_home():
    flight = at(28.0, 32.0, WITHOUT_LANDING, RTL_TYPE=2)
    assert passed(flight) == [(30, 30, 8), (30, 0, 5), (0, 0, 5), (0, 0, 0)]
    assert landed_at(flight, HOME)


def in_flown_mission(rtl_type: int, until: int) -> Flight:
    """In MISSION, on the way to item ``until``."""
    flight = hovering(5.0, RTL_RETURN_ALT=10.0, RTL_TYPE=rtl_type)
    upload(flight, *WITH_LANDING)
    assert set_mode(flight, Mode.MISSION) is Result.ACCEPTED
    flight.fly_until(lambda: flight.autopilot.missions.current == until, 60.0)
    return flight


@pytest.mark.parametrize(
    ("until", "targets"),
    [
        # One item behind it and three before: back over the takeoff; later on to the landing
        (1, [(0, 0, 5), (0, 0, 0)]),
        (2, [(30, 30, 8), (10, 45, 5), (0, 45, 5), (0, 45, 0)]),
    ],
)
def test_out_of_a_mission_the_way_with_fewer_items_is_taken(until, targets):
    flight = in_flown_mission(4, until)
    assert passed(flight)[-len(targets) :] == targets


def test_a_negative_delay_waits_above_home_for_good():
    flight = at(28.0, 32.0, WITHOUT_LANDING, RTL_TYPE=2, RTL_LAND_DELAY=-1.0, RTL_DESCEND_ALT=6.0)
    flight.ask(NAV_RETURN_TO_LAUNCH)
    flight.fly(60.0)
    assert landed_at(flight, HOME) and flight.height_m == pytest.approx(6.0, abs=0.2)
    assert flight.autopilot.arming.armed


@pytest.mark.parametrize("height_m", [math.inf, -math.inf, NAN])
def test_places_of_no_height_break_nothing(height_m):
    flight = at(20.0, 20.0, WITH_LANDING)
    upload(flight, *WITH_LANDING[:-1], item(kinds.LAND, 0.0, 45.0, height_m))
    upload(flight, item(kinds.RALLY_POINT, 25.0, 15.0, height_m), kind=MissionType.RALLY)
    for rtl_type in range(6):
        flight.parameters.set("RTL_TYPE", rtl_type)
        assert flight.ask(NAV_RETURN_TO_LAUNCH) is Result.ACCEPTED
        flight.fly(0.5)
        assert set_mode(flight, Mode.LOITER) is Result.ACCEPTED
