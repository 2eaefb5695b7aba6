"""Commands over the wire: PX4's answers, their order, and what they do to the vehicle."""

import math

import pytest
from pymavlink.dialects.v20 import development as dialect

from tests.sim_vehicle.vehicle_client import ARM_DISARM, REQUEST_MESSAGE, SET_INTERVAL, SET_MODE, Client

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
NAN = math.nan
PREARM_CHECK = 0x10000000
REBOOT, INJECT_FAILURE = 246, 420


def results(client: Client, number: int, *params: float, target: tuple[int, int] = (1, 1)) -> list[int]:
    client.forget()
    client.command(number, *params, target=target)
    client.run(0.02)
    return client.results(number)


@pytest.fixture
def client() -> Client:
    client = Client(system=255, component=190)
    client.heartbeat(kind=6)
    client.step()
    return client


# As a PX4 SITL answered on the ground, disarmed
@pytest.mark.parametrize(
    ("number", "params", "answers"),
    [
        (520, (1,), [ACCEPTED]),
        (410, (), [ACCEPTED]),
        (528, (1,), [ACCEPTED]),
        (SET_INTERVAL, (26, 100_000), [ACCEPTED]),
        *((SET_INTERVAL, (unknown, 100_000), [FAILED]) for unknown in (0, 27, 9999, -1)),
        # Another link's interval, or an answer to somebody else, cannot be asked for
        (SET_INTERVAL, (105, 4_000, 1), [FAILED]),
        (SET_INTERVAL, (105, 4_000, 0, 0, 0, 0, 1), [FAILED]),
        (SET_INTERVAL, (105, NAN), [FAILED]),
        (REQUEST_MESSAGE, (27,), [DENIED]),
        (REQUEST_MESSAGE, (360,), [DENIED]),
        (REQUEST_MESSAGE, (65,), [DENIED]),
        (241, (1,), [UNSUPPORTED]),
        (REBOOT, (0,), [ACCEPTED]),
        (REBOOT, (2,), [DENIED]),
        (401, (1,), [ACCEPTED]),
        (12345, (), [UNSUPPORTED]),
        (203, (), []),
        (2510, (), []),
        (ARM_DISARM, (5,), []),
        (ARM_DISARM, (0,), [ACCEPTED]),
        (SET_MODE, (1, 4, 3), [ACCEPTED, ACCEPTED]),
        (SET_MODE, (1, 9), [ACCEPTED, TEMPORARILY_REJECTED]),
        (INJECT_FAILURE, (4, 1, 0), [ACCEPTED]),
        (INJECT_FAILURE, (0, 1, 0), [UNSUPPORTED]),
    ],
)
def test_answers_on_the_ground(client, number, params, answers):
    assert results(client, number, *params) == answers


@pytest.mark.parametrize(
    ("target", "ours"),
    [((0, 0), True), ((0, 1), True), ((1, 0), True), ((2, 1), False), ((1, 191), False)],
)
def test_only_what_is_addressed_to_us_is_answered(client, target, ours):
    assert bool(results(client, SET_MODE, 1, 4, 3, target=target)) is ours


@pytest.mark.parametrize("custom", [(1, 1), (1, 4, 4), (1, 4, 6), (1, 4, 5), (1, 3)])
def test_modes_in_which_nobody_can_arm(client, custom):
    client.run(0.3)
    assert client.last("SYS_STATUS").onboard_control_sensors_health & PREARM_CHECK
    assert results(client, SET_MODE, *custom) == [ACCEPTED, ACCEPTED]
    client.run(0.3)
    assert not client.last("SYS_STATUS").onboard_control_sensors_health & PREARM_CHECK
    assert results(client, ARM_DISARM, 1) == [TEMPORARILY_REJECTED]
    # Force changes nothing
    assert results(client, ARM_DISARM, 1, 21196) == [TEMPORARILY_REJECTED]


def reboot(client: Client) -> None:
    assert results(client, REBOOT, 1) == [ACCEPTED]
    client.run(0.5)
    client.forget()


def test_a_reboot_is_silent_for_a_while_and_begins_anew(client):
    client.command(SET_INTERVAL, 105, 4_000)
    client.command(SET_MODE, 1, 1)
    client.run(1.0)
    reboot(client)
    client.run(1.5)
    assert client.received == []
    client.run(2.0)
    assert client.last("HEARTBEAT").custom_mode == 0x03040000
    # Its clock began anew, the wall's did not
    clock = client.last("SYSTEM_TIME")
    assert 500 < client.all("ATTITUDE")[0].time_boot_ms + 500 < 1_000 < clock.time_boot_ms < 2_000
    assert clock.time_unix_usec == pytest.approx(1e6 * client.time_s, abs=1e6)
    assert 50 < len(client.all("HIGHRES_IMU")) < 100


def test_no_reboot_while_armed(client):
    results(client, ARM_DISARM, 1)
    assert results(client, REBOOT, 1) == [DENIED]


def test_parameters_outlive_a_reboot_and_some_count_only_then(client):
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    for name, whole in (("MAV_SYS_ID", 42), ("IMU_INTEG_RATE", 400)):
        message = dialect.MAVLink_param_set_message(1, 1, name.encode(), 0.0, 6)
        client.push(message._pack(link, message.crc_extra, _whole_set(name, whole)))
    client.run(1.1)
    assert client.last("HEARTBEAT").get_srcSystem() == 1
    reboot(client)
    client.run(4.0)
    assert client.last("HEARTBEAT").get_srcSystem() == 42
    assert client.vehicle.interval_us == 2_500
    client.forget()
    client.command(SET_INTERVAL, 105, 1_000, target=(42, 1))
    begun_s = client.time_s
    for _ in range(4_000):
        client.step()
    imu = client.all("HIGHRES_IMU")
    assert len(imu) / (client.time_s - begun_s) == pytest.approx(395, abs=5)
    assert imu[-1].zacc == pytest.approx(-9.8, abs=1.5)


def _whole_set(name: str, whole: int) -> bytes:
    return whole.to_bytes(4, "little", signed=True) + bytes([1, 1]) + name.encode().ljust(16, b"\0") + bytes([6])


def test_set_mode_the_message_is_answered_once(client):
    client.send(dialect.MAVLink_set_mode_message(1, 1, 0x06040000))
    client.run(0.02)
    assert client.results(SET_MODE) == [ACCEPTED]
    client.run(1.0)
    assert client.last("HEARTBEAT").custom_mode == 0x06040000


def test_a_lost_gps_shows_and_comes_back(client):
    results(client, INJECT_FAILURE, 4, 1, 0)
    client.run(1.0)
    assert client.last("GPS_RAW_INT").fix_type == 0
    assert not client.last("SYS_STATUS").onboard_control_sensors_health & 0x20
    results(client, INJECT_FAILURE, 4, 0, 0)
    client.run(1.0)
    assert client.last("GPS_RAW_INT").fix_type == 3


def test_failures_are_refused_where_they_are_switched_off(client):
    client.send(dialect.MAVLink_param_set_message(1, 1, b"SYS_FAILURE_EN", 0.0, 6))
    assert results(client, INJECT_FAILURE, 4, 1, 0) == [DENIED]
