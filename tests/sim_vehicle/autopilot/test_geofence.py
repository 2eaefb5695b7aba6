"""The geofence: what is inside, what a breach does, what an upload may not do."""

import math

import pytest

from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM
from sim_vehicle.autopilot.flight_commands import DO_REPOSITION
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.geofence import shapes_of
from tests.sim_vehicle.autopilot.flying import ORIGIN, hovering, item, place, set_mode, upload
from tests.sim_vehicle.autopilot.kinematic_plant import Flight, target


def polygon(command: int, *corners: tuple[float, float]) -> list:
    return [item(command, north, east, params=(len(corners), 0, 0, 0)) for north, east in corners]


def circle(command: int, north: float, east: float, radius_m: float) -> list:
    return [item(command, north, east, params=(radius_m, 0, 0, 0))]


SQUARE = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
KEEP_IN = polygon(kinds.FENCE_POLYGON_INCLUSION, *SQUARE)


def outward(flight: Flight, north_m_s: float, seconds: float) -> None:
    """OFFBOARD away from home at that speed."""
    away = target(velocity=(north_m_s, 0.0, 0.0))
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
        (
            polygon(kinds.FENCE_POLYGON_INCLUSION, (0, 0), (10, 0), (10, 10), (5, 2), (0, 10)),
            (9.0, 5.0),
            (5.0, 8.0),
        ),
    ],
)
def test_what_shapes_allow(shape, inside, outside):
    (found,) = shapes_of(shape, ORIGIN)
    assert found.allows(*inside)
    assert not found.allows(*outside)


def test_a_breach_is_found_within_a_fifth_of_a_second_and_held_where_it_was_found():
    flight = hovering(5.0)
    upload(flight, *KEEP_IN, kind=MissionType.FENCE)
    outward(flight, 2.0, 5.0)
    away = target(velocity=(2.0, 0.0, 0.0))
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


def test_places_outside_the_fence_are_refused():
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
