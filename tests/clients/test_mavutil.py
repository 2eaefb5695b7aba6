"""pymavlink's own helpers on the simulated vehicle: heartbeat, modes, arming, parameters, its log reader."""

import os
import time

import pytest

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
from simulator import guarded_simulator, simulator, wait_until


# Plain TCP is what MAVProxy flies by, UDP through the guard what MAVSDK 3 does.
@pytest.fixture(params=["udp", "guarded tcp"])
def vehicle(request):
    guarded, _, kind = request.param.rpartition(" ")
    with (guarded_simulator if guarded else simulator)() as simulated:
        address = {"udp": f"udpin:127.0.0.1:{simulated.companion_port}", "tcp": f"tcp:127.0.0.1:{simulated.tcp_port}"}
        connection = mavutil.mavlink_connection(address[kind], source_system=255)
        yield connection
        connection.close()


def heartbeats(connection, seconds: float) -> None:
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        connection.mav.heartbeat_send(6, 8, 0, 0, 4)
        connection.recv_match(type="HEARTBEAT", blocking=True, timeout=1.0)


def test_heartbeat_modes_arming_takeoff_and_land(vehicle):
    assert vehicle.wait_heartbeat(timeout=5).autopilot == mavutil.mavlink.MAV_AUTOPILOT_PX4
    assert vehicle.target_system == 1
    assert {"LOITER", "OFFBOARD", "RTL", "TAKEOFF"} <= set(vehicle.mode_mapping())
    for mode in ("POSCTL", "LOITER"):
        vehicle.set_mode(mode)
        wait_until(
            lambda mode=mode: vehicle.recv_match(type="HEARTBEAT", timeout=1) and vehicle.flightmode == mode, 5, mode
        )
    vehicle.arducopter_arm()
    vehicle.motors_armed_wait()
    vehicle.set_mode("TAKEOFF")
    heartbeats(vehicle, 9.0)
    height_m = -vehicle.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=2).z
    assert height_m == pytest.approx(2.5, abs=0.5)
    vehicle.set_mode("LAND")
    vehicle.motors_disarmed_wait()


def has_all(connection) -> bool:
    value = connection.recv_match(type="PARAM_VALUE", blocking=True, timeout=1)
    return value is not None and len(connection.params) >= value.param_count


def test_parameters(vehicle):
    vehicle.wait_heartbeat(timeout=5)
    vehicle.param_fetch_all()
    wait_until(lambda: has_all(vehicle), 15, "all parameters")
    assert vehicle.params["MIS_TAKEOFF_ALT"] == 2.5
    for _ in range(5):
        # As a ground station does: again where the answer was lost
        vehicle.param_set_send("MIS_TAKEOFF_ALT", 4.0, mavutil.mavlink.MAV_PARAM_TYPE_REAL32)
        vehicle.recv_match(type="PARAM_VALUE", blocking=True, timeout=2)
    assert vehicle.params["MIS_TAKEOFF_ALT"] == 4.0
