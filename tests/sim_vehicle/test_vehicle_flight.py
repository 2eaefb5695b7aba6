"""Whole flights of the simulated vehicle, seen only through its MAVLink bytes."""

import pytest
from pymavlink.dialects.v20 import development as dialect

from tests.sim_vehicle.vehicle_client import ARM_DISARM, LAND, SET_INTERVAL, SET_MODE, TAKEOFF, Client

OFFBOARD, POSCTL, LOITER, LAND_MODE = 0x00060000, 0x00030000, 0x03040000, 0x06040000
CURRENT_MODE_ID, HIGHRES_IMU_ID = 436, 105
PX4_CUSTOM_OFFBOARD = (1, 6)


def in_offboard(client: Client, height_m: float = 2.0) -> Client:
    """Hovering in OFFBOARD."""

    def stream() -> None:
        client.setpoint(0.0, 0.0, -height_m)

    client.command(SET_INTERVAL, CURRENT_MODE_ID, 100_000)
    client.run(0.5, stream)
    client.command(SET_MODE, *PX4_CUSTOM_OFFBOARD)
    client.run(0.1, stream)
    client.command(ARM_DISARM, 1)
    client.run(11.0, stream)
    assert client.position() == pytest.approx((0.0, 0.0, -height_m), abs=0.15)
    return client


def test_on_the_ground_it_stands_still_and_ready():
    client = Client()
    client.run(5.0)
    beat = client.last("HEARTBEAT")
    assert (beat.type, beat.autopilot, beat.base_mode) == (2, 12, 0x1D)
    assert (beat.custom_mode, beat.system_status) == (LOITER, 3)
    assert client.last("EXTENDED_SYS_STATE").landed_state == 1
    assert client.last("HIGHRES_IMU").zacc == pytest.approx(-9.81, abs=1.5)
    assert client.speed() < 0.2
    assert client.all("STATUSTEXT") == []


def test_takeoff_hold_and_land():
    client = Client()
    client.run(1.5)
    client.command(TAKEOFF)
    client.command(ARM_DISARM, 1)
    client.run(0.1)
    assert client.results(TAKEOFF) == client.results(ARM_DISARM) == [0]
    client.run_until(lambda: client.last("EXTENDED_SYS_STATE").landed_state == 3, 5.0)
    client.run_until(lambda: client.last("HEARTBEAT").custom_mode == LOITER, 10.0)
    client.run(5.0)
    assert client.position()[2] == pytest.approx(-2.55, abs=0.2)
    assert client.speed() < 0.3
    assert client.last("HEARTBEAT").system_status == 4
    client.command(LAND)
    client.run_until(lambda: client.last("EXTENDED_SYS_STATE").landed_state == 4, 1.0)
    client.run_until(lambda: not client.armed(), 12.0)
    assert client.last("EXTENDED_SYS_STATE").landed_state == 1
    assert client.position()[2] == pytest.approx(0.0, abs=0.15)
    assert client.last("HEARTBEAT").custom_mode == LOITER


def test_offboard_follows_its_setpoints():
    client = in_offboard(Client())
    assert client.last("HEARTBEAT").base_mode == 0x91
    client.run(8.0, lambda: client.setpoint(3.0, -1.0, -2.0))
    assert client.position() == pytest.approx((3.0, -1.0, -2.0), abs=0.2)
    target = client.last("POSITION_TARGET_LOCAL_NED")
    assert (target.x, target.y, target.z) == (3.0, -1.0, -2.0)


def test_timesync_is_answered_and_asked():
    client = Client()
    client.run(1.0)
    client.forget()
    client.send(dialect.MAVLink_timesync_message(0, 987_654_321))
    client.step()
    (reply,) = [message for message in client.all("TIMESYNC") if message.tc1 != 0]
    assert reply.ts1 == 987_654_321
    # stamped inside the interval in which it arrived
    assert client.vehicle.time_boot_us - 4_000 < reply.tc1 / 1000 < client.vehicle.time_boot_us
    client.run(1.0)
    assert len([message for message in client.all("TIMESYNC") if message.tc1 == 0]) in (9, 10, 11)
