"""Commands and parameters over the wire: PX4's answers, their order, and what they do to the vehicle."""

import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import built_in_airframes, load_built_in
from sim_vehicle.parameters.airframe_values import defaults_from, position_gains
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.physics.layout import constants_from
from tests.sim_vehicle.vehicle_client import ARM_DISARM, REQUEST_MESSAGE, SET_INTERVAL, SET_MODE, Client

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
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
        (SET_INTERVAL, (105, math.nan), [ACCEPTED]),
        (REQUEST_MESSAGE, (27,), [DENIED]),
        (REQUEST_MESSAGE, (65,), [DENIED]),
        (241, (1,), [UNSUPPORTED]),
        (REBOOT, (0,), [ACCEPTED]),
        (REBOOT, (1,), [DENIED]),
        (401, (1,), [ACCEPTED]),
        (12345, (), [UNSUPPORTED]),
        *((number, (), []) for number in (203, 211, 220, 521, 2510, 42600)),
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


@pytest.mark.parametrize("target", [(0, 0), (0, 1), (1, 0), (2, 1), (1, 191)])
def test_only_what_is_addressed_to_us_is_answered(client, target):
    assert bool(results(client, SET_MODE, 1, 4, 3, target=target)) is (target[0] < 2 and target[1] < 2)


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


def test_failures_are_refused_where_they_are_switched_off(client):
    client.send(dialect.MAVLink_param_set_message(1, 1, b"SYS_FAILURE_EN", 0.0, 6))
    assert results(client, INJECT_FAILURE, 4, 1, 0) == [DENIED]


INT32, REAL32, UINT32 = 6, 9, 5


def whole_of(message) -> int:
    return struct.unpack_from("<i", message.get_msgbuf(), 10)[0]


def told(client: Client, message: dialect.MAVLink_message) -> list:
    client.forget()
    client.send(message)
    client.run(0.05)
    return client.all("PARAM_VALUE")


def request(client: Client, name: str = "", index: int = -1, target: tuple[int, int] = (1, 1)) -> list:
    return told(client, dialect.MAVLink_param_request_read_message(*target, name.encode(), index))


def set_to(client: Client, name: str, value: float, kind: int, target: tuple[int, int] = (1, 1)) -> list:
    return told(client, dialect.MAVLink_param_set_message(*target, name.encode(), value, kind))


def test_the_list_is_whole_and_in_order_and_each_is_told_by_name_or_index_and_when_it_is_set():
    client = Client()
    client.send(dialect.MAVLink_param_request_list_message(1, 1))
    client.run(0.5)
    listed = client.all("PARAM_VALUE")
    assert [message.param_index for message in listed] == list(range(listed[0].param_count))
    assert [message.param_id for message in listed] == sorted(Parameters())
    kinds = {message.param_id: message.param_type for message in listed}
    assert (kinds["MAV_SYS_ID"], kinds["MPC_XY_P"]) == (INT32, REAL32)
    (by_name,) = request(client, "MIS_TAKEOFF_ALT")
    assert by_name.param_value == 2.5
    (by_index,) = request(client, index=by_name.param_index)
    assert by_index.param_id == "MIS_TAKEOFF_ALT"
    (whole,) = request(client, "CAL_ACC0_ID")
    assert whole_of(whole) == 1310988
    (name_of_sixteen,) = request(client, "MPC_XY_VEL_P_ACC")
    assert name_of_sixteen.param_id == "MPC_XY_VEL_P_ACC"
    first, second = set_to(client, "MIS_TAKEOFF_ALT", 4.0, REAL32)
    assert first.param_value == second.param_value == 4.0
    assert client.vehicle.parameters["MIS_TAKEOFF_ALT"] == 4.0
    # The same once more is answered, but nothing has changed
    assert len(set_to(client, "MIS_TAKEOFF_ALT", 4.0, REAL32)) == 1


@pytest.mark.parametrize("target", [(2, 1), (0, 1), (1, 191)])
def test_a_request_for_another_or_for_everybody_is_not_answered(target):
    assert request(Client(), "MPC_XY_P", target=target) == []
    assert set_to(Client(), "MPC_XY_P", 1.0, REAL32, target) == []


# Among them numbers that are signalling NaNs as floats
@pytest.mark.parametrize("whole", [3, -1, -5_000_000, 2_139_100_000, 2**31 - 1, -(2**31)])
def test_whole_numbers_travel_byte_by_byte(whole):
    client = Client()
    message = dialect.MAVLink_param_set_message(1, 1, b"SYS_AUTOSTART", 0.0, INT32)
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    payload = struct.pack("<iBB16sB", whole, 1, 1, b"SYS_AUTOSTART", INT32)
    client.push(bytes(message._pack(link, message.crc_extra, payload)))
    client.run(0.05)
    assert whole_of(client.all("PARAM_VALUE")[0]) == whole
    assert client.vehicle.parameters.stored("SYS_AUTOSTART") == whole


@pytest.mark.parametrize(("name", "kind"), [("MAV_SYS_ID", REAL32), ("MPC_XY_P", INT32), ("MPC_XY_P", UINT32)])
def test_a_wrong_type_is_silently_ignored(name, kind):
    client = Client()
    before = client.vehicle.parameters.stored(name)
    assert set_to(client, name, 2.0, kind) == []
    assert client.vehicle.parameters.stored(name) == before


@pytest.mark.parametrize(("value", "counts"), [(100.0, 8.0), (-1.0, 0.5), (math.nan, 3.0), (math.inf, 8.0)])
def test_what_is_out_of_range_is_stored_but_does_not_count(value, counts):
    parameters = Parameters()
    parameters.set("MPC_Z_VEL_MAX_UP", value)
    assert str(parameters.stored("MPC_Z_VEL_MAX_UP")) == str(value)
    assert parameters["MPC_Z_VEL_MAX_UP"] == counts
    assert Client(parameters={"MPC_Z_VEL_MAX_UP": value}).vehicle.parameters["MPC_Z_VEL_MAX_UP"] == counts


@pytest.mark.parametrize("name", built_in_airframes())
def test_the_loops_begin_with_the_gains_that_the_parameters_tell(name):
    airframe = load_built_in(name)
    constants, parameters = constants_from(airframe, np.random.default_rng(1)), Parameters(defaults_from(airframe))
    for gain, value in position_gains(parameters).items():
        assert np.broadcast_to(constants[gain], np.shape(value)) == pytest.approx(value), gain


def test_a_gain_changes_how_the_vehicle_flies():
    # Given two vehicles that are asked 2 m to the side, of which one keeps the lower gain with which it begins
    def distance_after(gain: float) -> float:
        client = Client(parameters={"MPC_XY_P": 0.5})
        set_to(client, "MPC_XY_P", gain, REAL32)
        client.take_off(8.0)
        client.run(0.2, lambda: client.setpoint(2.0, 0.0, -2.0))
        client.command(176, 1, 6)
        client.run(1.0, lambda: client.setpoint(2.0, 0.0, -2.0))
        return client.position()[0]

    assert distance_after(0.5) < 0.75 * distance_after(1.5)
