"""Uploads in flight: missions with pause, resume and changes, and a geofence with its breaches; what is refused."""

import math

import pytest

from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM
from sim_vehicle.autopilot.flight_commands import DO_CHANGE_SPEED, DO_REPOSITION, MISSION_START
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.geofence import shapes_of
from sim_vehicle.estimator.estimate import yaw_of
from tests.sim_vehicle.autopilot import kinematic_plant
from tests.sim_vehicle.autopilot.kinematic_plant import Flight, hovering, item, north_east, place, set_mode, upload

TAKEOFF, NORTH, EAST = item(kinds.TAKEOFF), item(kinds.WAYPOINT, 20.0), item(kinds.WAYPOINT, 20.0, 20.0)
LAND_AT_HOME = item(kinds.LAND, 0.0, 0.0, 0.0)


def mission_state(flight: Flight) -> int:
    """MISSION_STATE: 1 no mission, 2 not started, 3 active, 5 complete."""
    missions = flight.autopilot.missions
    return missions.progress.state(len(missions.mission), missions.current)


def begun(*items: StoredItem) -> Flight:
    flight = Flight()
    upload(flight, *items)
    assert mission_state(flight) == 2, flight.texts()
    assert flight.ask(MISSION_START, 0) is Result.ACCEPTED
    assert flight.autopilot.modes.flown is Mode.MISSION and flight.autopilot.arming.armed and mission_state(flight) == 3
    return flight


def reached(flight: Flight, number: int) -> float:
    return flight.fly_until(lambda: flight.autopilot.missions.progress.reached >= number, 60.0)


@pytest.mark.parametrize("steps", range(4))
def test_a_mission_may_be_started_in_whatever_interval_its_upload_ends(steps):
    # Lists are judged every 8 ms; a start that came between the two was refused
    flight = Flight()
    for _ in range(steps):
        flight.step()
    flight.autopilot.missions.replace(MissionType.MISSION, (TAKEOFF, NORTH, LAND_AT_HOME))
    assert flight.ask(MISSION_START, 0) is Result.ACCEPTED


def test_a_mission_from_the_ground_and_back_disarms_says_so_and_begins_anew():
    flight = begun(TAKEOFF, NORTH, EAST, LAND_AT_HOME)
    for number, there in ((0, (0.0, 0.0)), (1, (20.0, 0.0)), (2, (20.0, 20.0))):
        reached(flight, number)
        # A place counts as reached within NAV_ACC_RAD, 2 m
        assert math.dist(north_east(flight), there) < 2.1
    flight.fly_until(lambda: not flight.autopilot.arming.armed, 60.0)
    assert math.dist(north_east(flight), (0.0, 0.0)) < 0.2
    assert mission_state(flight) == 5
    said = flight.texts()
    for text in ("Executing Mission", "Takeoff detected", "Mission finished, landed", "Disarmed by landing"):
        assert text in said
    assert said.index("Mission finished, landed") < said.index("Disarmed by landing")
    # Flown again it begins with the first item
    flight.fly(1.0)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    assert flight.autopilot.missions.current == 0
    reached(flight, 1)


def test_it_climbs_before_it_goes_where_the_first_place_is_higher():
    # Given a hover at 5 m and a first place at 15 m
    flight = hovering(5.0)
    upload(flight, item(kinds.WAYPOINT, 30.0, up_m=15.0))
    assert set_mode(flight, Mode.MISSION) is Result.ACCEPTED
    while flight.height_m < 14.0:
        flight.step()
        assert north_east(flight)[0] < 0.5
    assert "Climb to 15.0 meters above home" in flight.texts()
    reached(flight, 0)
    assert north_east(flight)[0] > 27.0


def test_times_radius_and_heading_are_kept_before_an_item_is_over():
    stays = item(kinds.WAYPOINT, 10.0, params=(4.0, 0.3, 0.0, 90.0))
    waits = item(kinds.LOITER_TIME, 10.0, params=(3.0, 0.0, 0.0, math.nan))
    flight = begun(TAKEOFF, stays, waits, kinematic_plant.action(kinds.DELAY, 2.0), NORTH)
    flight.fly_until(lambda: math.dist(north_east(flight), (10.0, 0.0)) < 0.3, 60.0)
    assert 4.0 < reached(flight, 1) < 6.0
    assert math.degrees(yaw_of(flight.state.attitude_wxyz)) == pytest.approx(90.0, abs=12.0)
    assert reached(flight, 2) == pytest.approx(3.0, abs=0.15)
    assert reached(flight, 3) == pytest.approx(2.0, abs=0.15)


def test_speed_is_changed_for_what_follows():
    flight = begun(TAKEOFF, kinematic_plant.action(kinds.DO_CHANGE_SPEED, 1, 2.0, -1), item(kinds.WAYPOINT, 30.0))
    reached(flight, 1)
    flight.fly(5.0)
    assert flight.state.velocity_ned_m_s[0] == pytest.approx(2.0, abs=0.1)
    # And by command at once
    flight.ask(DO_CHANGE_SPEED, 1, 4.0, -1)
    flight.fly(2.0)
    assert flight.state.velocity_ned_m_s[0] == pytest.approx(4.0, abs=0.1)


def test_return_as_an_item_returns():
    flight = begun(TAKEOFF, NORTH, kinematic_plant.action(kinds.RETURN_TO_LAUNCH))
    # Measured on PX4: the item counts as reached and the mission as finished before the mode is another, and
    # finished it stays (MAVSDK asks for that)
    told = []
    while flight.autopilot.modes.flown is Mode.MISSION:
        flight.step()
        told.append(flight.autopilot.missions.progress.reached)
    assert max(told) == 2
    assert flight.autopilot.modes.flown is Mode.RETURN and flight.autopilot.missions.progress.finished
    said = flight.texts()
    assert said.index("Mission finished, loitering") < said.index("Returning to launch")
    flight.fly_until(lambda: not flight.autopilot.arming.armed, 120.0)
    assert flight.autopilot.modes.intended is Mode.LOITER


@pytest.mark.parametrize("stays", [{"autocontinue": 0}, {"up_m": math.inf}, {"up_m": math.nan}])
def test_an_item_without_autocontinue_is_stayed_at_and_before_one_of_no_height(stays):
    flight = begun(TAKEOFF, item(kinds.WAYPOINT, 10.0, **stays), NORTH)
    reached(flight, 0)
    flight.fly(20.0)
    assert flight.autopilot.missions.current == 1 and flight.height_m == pytest.approx(5.0, abs=0.9)
    assert math.dist(north_east(flight), (0.0 if "up_m" in stays else 10.0, 0.0)) < 0.1


def test_pause_holds_and_resume_goes_on_with_the_same_item():
    flight = begun(TAKEOFF, NORTH, EAST, LAND_AT_HOME)
    reached(flight, 1)
    flight.fly(1.0)
    assert set_mode(flight, Mode.LOITER) is Result.ACCEPTED
    flight.fly(8.0)
    assert math.hypot(*flight.state.velocity_ned_m_s) < 0.05
    assert flight.autopilot.missions.current == 2 and flight.autopilot.missions.progress.reached == -1
    assert set_mode(flight, Mode.MISSION) is Result.ACCEPTED
    reached(flight, 2)
    assert math.dist(north_east(flight), (20.0, 20.0)) < 2.1


def test_a_mission_cleared_in_flight_is_a_failsafe():
    # A mode that has lost what it needs cannot run: PX4 returns
    flight = begun(TAKEOFF, NORTH, EAST)
    reached(flight, 1)
    upload(flight)
    flight.fly(0.1)
    assert "No valid mission available, loitering" in flight.texts()
    assert (flight.autopilot.modes.flown, flight.autopilot.modes.intended) == (Mode.RETURN, Mode.MISSION)
    assert flight.autopilot.commander.system_status == 5


@pytest.mark.parametrize(
    ("items", "text"),
    [
        ([LAND_AT_HOME, NORTH], "Mission rejected: starts with landing"),
        ([NORTH, TAKEOFF], "Mission rejected: takeoff not first waypoint item"),
        ([item(kinds.TAKEOFF, up_m=-1.0)], "Mission rejected: Takeoff altitude below home altitude!"),
    ],
)
def test_missions_that_cannot_be_flown_are_stored_but_not_started(items, text):
    flight = Flight()
    upload(flight, *items)
    assert text in flight.texts() and mission_state(flight) == 1
    assert flight.ask(MISSION_START, 0) is Result.DENIED
    assert "Mission start denied! No valid mission" in flight.texts()


def polygon(command: int, *corners: tuple[float, float]) -> list:
    return [item(command, north, east, params=(len(corners), 0, 0, 0)) for north, east in corners]


def circle(command: int, north: float, east: float, radius_m: float) -> list:
    return [item(command, north, east, params=(radius_m, 0, 0, 0))]


SQUARE = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
KEEP_IN = polygon(kinds.FENCE_POLYGON_INCLUSION, *SQUARE)


def outward(flight: Flight, north_m_s: float, seconds: float) -> None:
    away = kinematic_plant.target(velocity=(north_m_s, 0.0, 0.0))
    flight.fly(0.2, away)
    assert set_mode(flight, Mode.OFFBOARD) is Result.ACCEPTED
    flight.fly(seconds, away)


@pytest.mark.parametrize(
    ("shape", "inside", "outside"),
    [
        (KEEP_IN, (0.0, 0.0), (25.0, 0.0)),
        (KEEP_IN, (19.9, -19.9), (-20.1, 0.0)),
        (polygon(kinds.FENCE_POLYGON_EXCLUSION, *SQUARE), (25.0, 0.0), (0.0, 0.0)),
        (circle(kinds.FENCE_CIRCLE_INCLUSION, 5.0, 0.0, 10.0), (14.9, 0.0), (15.1, 0.0)),
        (circle(kinds.FENCE_CIRCLE_EXCLUSION, 5.0, 0.0, 10.0), (0.0, 12.0), (5.0, 9.0)),
        # A notch: a polygon that is not convex
        (polygon(kinds.FENCE_POLYGON_INCLUSION, (0, 0), (10, 0), (10, 10), (5, 2), (0, 10)), (9.0, 5.0), (5.0, 8.0)),
    ],
)
def test_what_shapes_allow(shape, inside, outside):
    (found,) = shapes_of(shape, kinematic_plant.ORIGIN)
    assert found.allows(*inside)
    assert not found.allows(*outside)


def test_places_outside_the_fence_are_refused_and_a_breach_is_found_within_a_fifth_of_a_second_and_held_there():
    flight = hovering(5.0)
    upload(flight, *KEEP_IN, kind=MissionType.FENCE)
    flight.ask(DO_REPOSITION, -1, 1, 0, math.nan, *place(50.0, 0.0), math.nan)
    assert "Reposition is outside geofence" in flight.texts()
    flight.fly(5.0)
    assert abs(flight.state.position_ned_m[0]) < 0.1
    # And a mission that leads there cannot be flown
    upload(flight, item(kinds.WAYPOINT, 10.0), item(kinds.WAYPOINT, 30.0))
    assert "Geofence violation for waypoint 2" in flight.texts()
    assert not flight.autopilot.missions.progress.valid
    # When it is flown out all the same, then that is found
    outward(flight, 2.0, 5.0)
    away = kinematic_plant.target(velocity=(2.0, 0.0, 0.0))
    flight.fly_until(lambda: flight.autopilot.modes.flown is not Mode.OFFBOARD, 10.0, away)
    found_at = flight.state.position_ned_m[0]
    assert 0.0 < found_at - 20.0 < 2.0 * (0.2 + 0.1)
    assert flight.texts()[-1] == "Failsafe activated"
    flight.fly(10.0)
    assert flight.state.position_ned_m[0] == pytest.approx(found_at, abs=0.3)
    # And the pilot can leave the hold by a mode
    assert set_mode(flight, Mode.RETURN) is Result.ACCEPTED
    flight.fly(0.2)
    assert (flight.autopilot.modes.flown, flight.autopilot.commander.system_status) == (Mode.RETURN, 4)


def test_a_fence_that_excludes_home_or_the_vehicle_is_left_out():
    flight = Flight()
    upload(flight, *circle(kinds.FENCE_CIRCLE_EXCLUSION, 0.0, 0.0, 5.0), kind=MissionType.FENCE)
    assert "Geofence invalid, doesn't contain Home position" in flight.texts()
    flight = hovering(5.0)
    outward(flight, 5.0, 8.0)
    upload(flight, *KEEP_IN, kind=MissionType.FENCE)
    assert "Geofence invalid, doesn't contain current vehicle position" in flight.texts()
    assert not flight.autopilot.navigator.fence.breached


def test_outside_its_fence_a_vehicle_is_not_armed():
    flight = Flight()
    upload(flight, *KEEP_IN, kind=MissionType.FENCE)
    flight.state = flight.state._replace(position_ned_m=(30.0, 0.0, 0.0))
    flight.fly(0.5)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED
    assert flight.texts()[-2:] == [
        "Geofence: approaching or outside geofence",
        "Arming denied: Resolve system health failures first",
    ]
