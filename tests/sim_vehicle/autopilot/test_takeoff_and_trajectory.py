"""How the modes fly: takeoff, hold, land, return."""

import math

import pytest

from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, NAV_LAND, NAV_RETURN_TO_LAUNCH
from sim_vehicle.autopilot.flight_commands import NAV_TAKEOFF
from sim_vehicle.autopilot.flight_tasks.auto_flight import land_speed_m_s
from sim_vehicle.autopilot.flight_tasks.smoothing import Smoother
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.rtl import return_height_over
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.flying import hovering
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

DEFAULTS = Parameters()


def test_takeoff_waits_for_the_motors_climbs_to_two_and_a_half_metres_and_holds():
    flight = Flight()
    flight.ask(NAV_TAKEOFF)
    flight.ask(COMPONENT_ARM_DISARM, 1)
    left_after_s = flight.fly_until(lambda: flight.height_m > 0.01, 5.0)
    # One second of spooling up, then the ramp from -2.45 m/s, which passes zero after 45 % of its 3 s;
    # the first centimetre takes another 0.2 s at the speed that is allowed then
    assert left_after_s == pytest.approx(1.0 + 1.35 + 0.2, abs=0.03)
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
