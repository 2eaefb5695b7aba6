"""Commands that steer: takeoff to a height, reposition, orbit, follow."""

import math

import pytest

from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM
from sim_vehicle.autopilot.flight_commands import DO_ORBIT, DO_REPOSITION, NAV_TAKEOFF
from sim_vehicle.autopilot.messages import FollowTarget, Result
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.estimator.estimate import yaw_of
from tests.sim_vehicle.autopilot.flying import ORIGIN, hovering, north_east, place, set_mode
from tests.sim_vehicle.autopilot.kinematic_plant import Flight, target

NAN = math.nan
SEA_LEVEL_HOME_M = ORIGIN.place.altitude_m


def test_takeoff_goes_to_the_height_and_over_the_place_that_the_command_names():
    flight = Flight()
    assert flight.ask(NAV_TAKEOFF, 0, 0, 0, NAN, *place(0.0, 0.0), SEA_LEVEL_HOME_M + 7.0) is Result.ACCEPTED
    flight.ask(COMPONENT_ARM_DISARM, 1)
    flight.fly_until(lambda: flight.autopilot.modes.flown is Mode.LOITER, 20.0)
    flight.fly(5.0)
    assert flight.height_m == pytest.approx(7.0, abs=0.05)
    assert "Using default takeoff altitude: 2.5 m" not in flight.texts()


def test_a_takeoff_to_latitude_and_longitude_0_stays_on_the_ground_until_it_disarms():
    # As PX4: 0/0 is a place, 5000 km away, and the way there does not climb
    flight = Flight()
    assert flight.ask(NAV_TAKEOFF, 0, 0, 0, 0, 0.0, 0.0, SEA_LEVEL_HOME_M + 10.0) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    flight.fly(10.0)
    assert flight.autopilot.arming.armed and flight.height_m == 0.0
    flight.fly(1.5)
    assert not flight.autopilot.arming.armed


def test_reposition_flies_there_at_the_speed_asked_for_and_holds():
    flight = hovering(5.0)
    asked = (3.0, 1, 0, math.radians(90.0), *place(30.0, 0.0), SEA_LEVEL_HOME_M + 8.0)
    assert flight.ask(DO_REPOSITION, *asked) is Result.ACCEPTED
    flight.fly(5.0)
    assert flight.state.velocity_ned_m_s[0] == pytest.approx(3.0, abs=0.1)
    flight.fly(15.0)
    assert math.dist(north_east(flight), (30.0, 0.0)) < 0.1
    assert flight.height_m == pytest.approx(8.0, abs=0.05)
    assert yaw_of(flight.state.attitude_wxyz) == pytest.approx(math.pi / 2, abs=0.02)


def test_a_reposition_of_nothing_stops_the_vehicle():
    flight = hovering(5.0)
    moving = target(velocity=(4.0, 0.0, 0.0))
    flight.fly(0.2, moving)
    set_mode(flight, Mode.OFFBOARD)
    flight.fly(4.0, moving)
    begun = north_east(flight)[0]
    assert flight.ask(DO_REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN) is Result.ACCEPTED
    flight.fly(8.0)
    assert flight.autopilot.modes.flown is Mode.LOITER
    # v (v / 2a + 0.6 s) with 3 m/s^2
    assert north_east(flight)[0] - begun == pytest.approx(4.0 * (4.0 / 6.0 + 0.6), abs=0.6)


@pytest.mark.parametrize("flags", [0, 2, 3])
def test_a_reposition_without_the_change_of_mode_is_not_supported(flags):
    assert hovering(5.0).ask(DO_REPOSITION, -1, flags, 0, NAN, NAN, NAN, NAN) is Result.UNSUPPORTED


@pytest.mark.parametrize("radius_m", [10.0, -10.0])
def test_an_orbit_keeps_its_radius_its_speed_and_its_eye_on_the_centre(radius_m):
    flight = hovering(5.0)
    asked = (radius_m, 3.0, 0, NAN, *place(20.0, 0.0), SEA_LEVEL_HOME_M + 8.0)
    assert flight.ask(DO_ORBIT, *asked) is Result.ACCEPTED
    flight.fly(14.0)
    for _ in range(20):
        flight.fly(0.5)
        out = north_east(flight)[0] - 20.0, north_east(flight)[1]
        assert math.hypot(*out) == pytest.approx(10.0, abs=1.0)
        v = flight.state.velocity_ned_m_s
        assert math.hypot(v[0], v[1]) == pytest.approx(3.0, abs=0.3)
        # Clockwise seen from above: north, then east
        assert (out[0] * v[1] - out[1] * v[0] > 0) == (radius_m > 0)
        looks = math.atan2(-out[1], -out[0])
        assert abs(math.remainder(yaw_of(flight.state.attitude_wxyz) - looks, 2 * math.pi)) < 0.2
    assert flight.height_m == pytest.approx(8.0, abs=0.1)
    assert flight.autopilot.navigator.orbit_status[0] == radius_m


def test_an_orbit_too_wide_is_not_flown_and_one_too_fast_is_slowed():
    flight = hovering(5.0)
    flight.ask(DO_ORBIT, 2000.0, 3.0, 0, NAN, NAN, NAN, NAN)
    assert "Orbit radius limit exceeded" in flight.texts()
    flight.ask(DO_ORBIT, 4.0, 10.0, 0, NAN, *place(4.0, 0.0), NAN)
    flight.fly(12.0)
    # v^2 / r stays below 2 m/s^2
    assert math.hypot(*flight.state.velocity_ned_m_s[:2]) == pytest.approx(math.sqrt(8.0), abs=0.3)


def test_following_stays_behind_and_above_and_looks_at_the_target():
    flight = hovering(5.0, FLW_TGT_HT=10.0, FLW_TGT_DST=6.0)
    assert set_mode(flight, Mode.FOLLOW_TARGET) is Result.ACCEPTED
    for second in range(30):
        there = ORIGIN.place_at((2.0 * second, 0.0, 0.0))
        flight.autopilot.receive(FollowTarget(there, (2.0, 0.0, 0.0)))
        flight.fly(1.0)
    assert 60.0 - north_east(flight)[0] == pytest.approx(6.0, abs=2.0)
    assert flight.height_m == pytest.approx(10.0, abs=0.1)
    assert yaw_of(flight.state.attitude_wxyz) == pytest.approx(0.0, abs=0.1)
    # And without messages it stops
    flight.fly(8.0)
    assert math.hypot(*flight.state.velocity_ned_m_s) < 0.1
