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
        (SET_INTERVAL, (30, 100_000), [ACCEPTED]),
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
        (REBOOT, (1,), [DENIED]),
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


@pytest.mark.parametrize("custom", [(1, 4, 4), (1, 4, 6), (1, 4, 5), (1, 3)])
def test_modes_in_which_nobody_can_arm(client, custom):
    client.run(0.3)
    assert client.last("SYS_STATUS").onboard_control_sensors_health & PREARM_CHECK
    assert results(client, SET_MODE, *custom) == [ACCEPTED, ACCEPTED]
    client.run(0.3)
    assert not client.last("SYS_STATUS").onboard_control_sensors_health & PREARM_CHECK
    assert results(client, ARM_DISARM, 1) == [TEMPORARILY_REJECTED]
    # Force changes nothing
    assert results(client, ARM_DISARM, 1, 21196) == [TEMPORARILY_REJECTED]


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
