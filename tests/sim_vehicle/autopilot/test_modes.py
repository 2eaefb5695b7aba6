"""The modes: numbers, every row of their table, and how they fly: takeoff, hold, land, return, orbit, follow."""

import math

import pytest

from sim_vehicle.autopilot import modes
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, NAV_LAND, NAV_RETURN_TO_LAUNCH
from sim_vehicle.autopilot.flight_commands import DO_ORBIT, DO_REPOSITION, NAV_TAKEOFF
from sim_vehicle.autopilot.flight_tasks.auto_flight import land_speed_m_s
from sim_vehicle.autopilot.flight_tasks.smoothing import Smoother
from sim_vehicle.autopilot.land_detector import LandDetector
from sim_vehicle.autopilot.messages import FollowTarget, Result
from sim_vehicle.autopilot.modes import TRANSITIONS, Conditions, Mode, ModeEvent, Need, find_transition
from sim_vehicle.autopilot.navigator.rtl import return_height_over
from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot import kinematic_plant
from tests.sim_vehicle.autopilot.kinematic_plant import ORIGIN, Flight, hovering, north_east, place, set_mode, target

DISARMED = Conditions(False)
ASKED_FOR = [row.target for row in TRANSITIONS if row.event is ModeEvent.REQUEST]


def armed(*missing: Need) -> Conditions:
    return Conditions(True, frozenset(Need) - set(missing))


@pytest.mark.parametrize("mode", ASKED_FOR)
def test_armed_a_mode_is_accepted_that_has_what_it_needs(mode):
    assert find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(), mode) is not None
    for need in modes.NEEDS[mode]:
        without = find_transition(Mode.LOITER, ModeEvent.REQUEST, armed(need), mode)
        # LAND must always be there, be it without a position
        assert (without is not None) == (mode is Mode.LAND), need


@pytest.mark.parametrize("ends_in", [Mode.LAND, Mode.RETURN, Mode.TAKEOFF, Mode.ORBIT, Mode.FOLLOW_TARGET])
def test_after_disarming_the_mode_before_is_meant(ends_in):
    # Given a flight in OFFBOARD that went on in a mode in which nobody can arm
    state = modes.ModeState()
    assert state.apply(ModeEvent.REQUEST, armed(), Mode.OFFBOARD)
    assert state.apply(ModeEvent.REQUEST, armed(), ends_in)
    # When the vehicle disarms
    assert state.apply(ModeEvent.DISARMED, DISARMED)
    # Then OFFBOARD is meant again
    assert state.intended is Mode.OFFBOARD


DEFAULTS = Parameters()


@pytest.mark.parametrize(("ramp_s", "climbs_after_s"), [(3.0, 1.35 + 0.2), (0.0, 0.05)])
def test_takeoff_waits_for_the_motors_climbs_to_two_and_a_half_metres_and_holds(ramp_s, climbs_after_s):
    flight = Flight(MPC_TKO_RAMP_T=ramp_s)
    flight.ask(NAV_TAKEOFF)
    flight.ask(COMPONENT_ARM_DISARM, 1)
    left_after_s = flight.fly_until(lambda: flight.height_m > 0.01, 5.0)
    # One second of spooling up, then the ramp from -2.45 m/s, which passes zero after 45 % of its 3 s;
    # the first centimetre takes another 0.2 s at the speed that is allowed then
    assert left_after_s == pytest.approx(1.0 + climbs_after_s, abs=0.03)
    fastest = 0.0
    while flight.autopilot.modes.flown is Mode.TAKEOFF:
        flight.step()
        fastest = max(fastest, -flight.state.velocity_ned_m_s[2])
        assert flight.time_s < 12.0
    # PX4 counts a height as reached 0.8 m before it
    assert flight.height_m == pytest.approx(1.7, abs=0.08)
    assert 1.0 < fastest <= 1.55
    flight.fly(5.0)
    assert flight.height_m == pytest.approx(2.5, abs=0.02)


def test_armed_and_left_alone_it_stays_on_the_ground_and_disarms():
    for mode_command in (None, NAV_LAND, NAV_RETURN_TO_LAUNCH):
        flight = Flight()
        flight.ask(COMPONENT_ARM_DISARM, 1)
        if mode_command is not None:
            flight.ask(mode_command)
        waited_s = flight.fly_until(lambda flight=flight: not flight.autopilot.arming.armed, 12.0)
        assert waited_s == pytest.approx(11.0, abs=0.02)
        assert flight.height_m == 0.0
        assert flight.autopilot.texts[-1].text == "Disarmed by auto preflight disarming"
        assert flight.parameters["COM_FLIGHT_UUID"] == 1


def test_landing_sinks_at_seventy_centimetres_a_second_and_disarms_on_the_ground():
    flight = hovering(2.5)
    flight.ask(NAV_LAND)
    flight.fly(1.5)
    assert flight.state.velocity_ned_m_s[2] == pytest.approx(0.7, abs=0.01)
    flight.fly_until(lambda: flight.height_m == 0.0, 5.0)
    waited_s = flight.fly_until(lambda: not flight.autopilot.arming.armed, 5.0)
    # The land detector's second and COM_DISARM_LAND's two
    assert waited_s == pytest.approx(3.0, abs=0.5)
    texts = [text.text for text in flight.autopilot.texts]
    assert texts[-3:] == ["Landing at current position", "Landing detected", "Disarmed by landing"]
    assert flight.autopilot.modes.flown is Mode.LOITER


def test_landing_is_faster_high_up():
    assert land_speed_m_s(3.0, DEFAULTS) == land_speed_m_s(5.0, DEFAULTS) == pytest.approx(0.7)
    assert land_speed_m_s(7.5, DEFAULTS) == pytest.approx(1.1)
    assert land_speed_m_s(10.0, DEFAULTS) == land_speed_m_s(50.0, DEFAULTS) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("height_m", "distance_m", "expected_m"),
    [
        (2.5, 0.0, 2.5),  # above home: nothing to climb for
        (1.0, 1.5, 3.0),  # within the acceptance radius: twice the distance
        (1.0, 3.0, 4.0),  # at least twice the acceptance radius
        (1.0, 8.0, 8.0),  # a cone of 45 degrees up to 10 m away
        (1.0, 10.1, 30.0),
        (40.0, 100.0, 40.0),  # never down
    ],
)
def test_return_flies_at_px4s_height(height_m, distance_m, expected_m):
    assert return_height_over(height_m, distance_m, DEFAULTS) == pytest.approx(expected_m)


def test_a_smoothed_setpoint_keeps_its_limits_and_does_not_run_past():
    smoother = Smoother(DEFAULTS)
    smoother.start((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    step_s, before = 0.008, (0.0, 0.0, 0.0)
    for _ in range(3000):
        smoother.advance((30.0, -40.0, -6.0), step_s, cruise_m_s=5.0)
        velocity = smoother.velocity_ned_m_s
        assert math.hypot(*velocity[:2]) <= 5.0 + 1e-9
        assert -3.0 - 1e-9 <= velocity[2] <= 0.01
        assert math.dist(velocity[:2], before[:2]) <= 3.0 * step_s + 1e-9
        assert smoother.position_ned_m[2] >= -6.0 - 1e-4
        before = velocity
    assert smoother.position_ned_m == pytest.approx((30.0, -40.0, -6.0), abs=1e-3)
    assert smoother.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


STEP_US = 8_000
STILL = (0.0, 0.0, 0.0)
HOVER = 0.5
# 60 % and 10 % of the way from PX4's least thrust, 0.12, to hover.
LOW, NONE = 0.34, 0.15


class Detection:
    """A detector that has taken off, fed at 125 Hz."""

    def __init__(self) -> None:
        self.detector = LandDetector(HOVER, Parameters())
        self.now_us = 0
        self.feed(0.1, thrust=HOVER, asked_down=None)
        assert not self.detector.landed

    def feed(self, seconds, thrust, asked_down=0.7, velocity=STILL, rate=STILL, force=(0, 0, -9.8), armed=True):
        estimate = kinematic_plant.STANDING._replace(
            velocity_ned_m_s=velocity,
            angular_velocity_frd_rad_s=rate,
            specific_force_frd_m_s2=force,
            thrust_fraction=thrust,
        )
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.now_us += STEP_US
            self.detector.update(estimate._replace(time_boot_us=self.now_us), armed, asked_down)


@pytest.mark.parametrize(
    ("hinders", "touches"),
    [
        *(({"asked_down": speed_m_s}, False) for speed_m_s in (None, 0.25, -1.0)),
        *(({"velocity": velocity}, False) for velocity in ((0.0, 0.0, 0.3), (1.6, 0.0, 0.0))),
        ({"thrust": LOW + 0.02}, False),
        *((hinders, True) for hinders in ({"rate": (0.4, 0.0, 0.0)}, {"thrust": LOW}, {"force": (0, 0, -1)})),
    ],
    ids=str,
)
def test_what_keeps_it_flying_and_ground_contact_alone_is_no_landing(hinders, touches):
    detection = Detection()
    detection.feed(5.0, **{"thrust": NONE, **hinders})
    assert detection.detector.ground_contact is touches and not detection.detector.maybe_landed


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


@pytest.mark.parametrize("flags", [0, 1, 2, 3])
def test_reposition_flies_there_at_the_speed_asked_for_and_holds(flags):
    flight = hovering(5.0)
    asked = (3.0, flags, 0, math.radians(90.0), *place(30.0, 0.0), SEA_LEVEL_HOME_M + 8.0)
    # Without the change of mode alone it is flown, too, as in hold
    assert flight.ask(DO_REPOSITION, *asked) is (Result.ACCEPTED if flags == 1 else Result.UNSUPPORTED)
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
