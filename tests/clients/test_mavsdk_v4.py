"""MAVSDK for Python, the native binding (version 4), through each of its capabilities.

Real time, three times as fast: every flight is short.
"""

import math
import time

import pytest
from mavsdk.plugins import offboard as offboard_types
from mavsdk.plugins.action import OrbitYawBehavior
from mavsdk.plugins.info import Info
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import FlightMode
from mavsdk_vehicle import METRE_DEG, flown
from simulator import wait_until


@pytest.fixture
def vehicle():
    with flown(3) as connected:
        yield connected


TELEMETRY = (
    *("position", "home", "in_air", "landed_state", "armed", "attitude_quaternion", "attitude_euler"),
    *("attitude_angular_velocity_body", "velocity_ned", "gps_info", "raw_gps", "battery", "flight_mode"),
    *("health", "rc_status", "odometry", "position_velocity_ned", "imu", "health_all_ok", "unix_epoch_time"),
    *("scaled_pressure", "heading", "altitude", "vtol_state"),
)


def test_telemetry_of_every_kind_and_who_it_is(vehicle):
    info, told = Info(vehicle.system), {}
    for name in TELEMETRY:
        getattr(vehicle.telemetry, f"subscribe_{name}")(lambda value, _, name=name: told.update({name: value}))
    info.subscribe_flight_information(lambda value, _: told.update(flight=value))
    wait_until(lambda: told.keys() == {*TELEMETRY, "flight"}, 15, "told of everything")
    assert None not in told.values()
    version = info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == (1, 17)
    assert info.get_identification().legacy_uid > 0
    assert info.get_speed_factor() == pytest.approx(3.0, abs=0.9)


def test_all_parameters_and_single_ones(vehicle):
    param = Param(vehicle.system)
    everything = param.get_all_params()
    assert len(everything.int_params) + len(everything.float_params) > 100
    assert param.get_param_int("MAV_SYS_ID") == 1
    param.set_param_float("MPC_XY_CRUISE", 6.0)
    assert param.get_param_float("MPC_XY_CRUISE") == 6.0
    vehicle.action.set_takeoff_altitude(4.0)
    assert vehicle.action.get_takeoff_altitude() == 4.0
    vehicle.action.set_return_to_launch_altitude(12.0)
    assert vehicle.action.get_return_to_launch_altitude() == 12.0


def test_takeoff_go_to_orbit_return_and_land(vehicle):
    vehicle.take_off()
    with pytest.raises(Exception, match="COMMAND_DENIED"):
        vehicle.action.disarm()
    vehicle.action.set_current_speed(4.0)
    (north, east), height_m = vehicle.place, vehicle.telemetry.position().absolute_altitude_m
    vehicle.action.goto_location(north + 9 * METRE_DEG, east, height_m, 0.0)
    wait_until(lambda: vehicle.ned[0] > 7.5, 20, "there")
    vehicle.action.do_orbit(5.0, 2.0, OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER, north, east, height_m)
    # An orbit shows as a kind of position mode
    wait_until(lambda: vehicle.flies(FlightMode.POSCTL), 5, "circling")
    vehicle.action.hold()
    wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "holding")
    vehicle.action.return_to_launch()
    wait_until(lambda: vehicle.flies(FlightMode.RETURN_TO_LAUNCH), 5, "returning")
    vehicle.action.land()
    vehicle.wait_for_landing()
    said = {"Armed by external command", "Takeoff detected", "Landing detected", "Disarmed by landing"}
    wait_until(lambda: said <= set(vehicle.texts), 5, "all that was to be said")


def test_offboard_by_position_velocity_body_attitude_and_rates(vehicle):
    offboard, types = offboard_types.Offboard(vehicle.system), offboard_types
    vehicle.take_off()
    with pytest.raises(Exception, match="NO_SETPOINT_SET"):
        offboard.start()
    there, still = types.PositionNedYaw(3.0, 0.0, -3.0, 90.0), types.VelocityNedYaw(0.0, 0.0, 0.0, 90.0)
    offboard.set_position_ned(there)
    offboard.start()
    wait_until(lambda: math.dist(vehicle.ned, (3.0, 0.0, -3.0)) < 0.4, 15, "there")

    def flies_east_at(low_m_s, high_m_s):
        wait_until(lambda: low_m_s < vehicle.telemetry.velocity_ned().east_m_s < high_m_s, 15, "as fast as asked")

    offboard.set_velocity_ned(types.VelocityNedYaw(0.0, 1.0, 0.0, 90.0))
    flies_east_at(0.8, 1.2)
    # The nose points east: forward is east
    offboard.set_velocity_body(types.VelocityBodyYawspeed(-1.0, 0.0, 0.0, 0.0))
    flies_east_at(-1.2, -0.7)
    offboard.set_position_velocity_ned(there, still)
    wait_until(lambda: math.dist(vehicle.ned, (3.0, 0.0, -3.0)) < 0.4, 15, "there again")
    offboard.set_attitude(types.Attitude(0.0, -5.0, 90.0, 0.78))
    wait_until(lambda: vehicle.telemetry.attitude_euler().pitch_deg < -3.0, 15, "leaning")
    offboard.set_attitude_rate(types.AttitudeRate(0.0, 5.0, 0.0, 0.78))
    time.sleep(0.4)
    offboard.set_acceleration_ned(types.AccelerationNed(0.0, 0.0, 0.0))
    time.sleep(0.2)
    offboard.set_velocity_ned(still)
    flies_east_at(-0.2, 0.2)
    offboard.stop()
    wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "holding")
    vehicle.action.land()
    vehicle.wait_for_landing()
