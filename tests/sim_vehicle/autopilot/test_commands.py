"""Commands and what they are answered with."""

import math

import pytest

from sim_vehicle.autopilot import commands
from sim_vehicle.autopilot.commands import (
    COMPONENT_ARM_DISARM,
    DO_SET_MODE,
    GET_MESSAGE_INTERVAL,
    NAV_TAKEOFF,
    REQUEST_MESSAGE,
    SET_MESSAGE_INTERVAL,
)
from sim_vehicle.autopilot.messages import Command, Identity, Result
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

NAN = math.nan


class StreamsThatKnow105:
    """Accepts HIGHRES_IMU only and remembers what was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, int, float]] = []

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        self.asked.append(("set", message_id, interval_us))
        return message_id == 105

    def announce_interval(self, message_id: int) -> None:
        self.asked.append(("announce", message_id, 0.0))

    def send_now(self, message_id: int, index: int = 0) -> bool:
        self.asked.append(("send", message_id, 0.0))
        return message_id == 105


def command(number: int, *params: float, target: tuple[int, int] = (1, 1)) -> Command:
    a, b, c, d, e, f, g = (*params, *[0.0] * (7 - len(params)))
    return Command(255, 190, *target, number, a, b, c, d, e, f, g)


@pytest.mark.parametrize(
    ("asked", "result"),
    [
        (command(SET_MESSAGE_INTERVAL, 105, 4000), Result.ACCEPTED),
        (command(SET_MESSAGE_INTERVAL, 105, 4000, NAN, NAN, NAN, NAN, NAN), Result.ACCEPTED),
        (command(SET_MESSAGE_INTERVAL, 27, 4000), Result.FAILED),
        (command(SET_MESSAGE_INTERVAL, 105, 4000, 1), Result.FAILED),
        (command(SET_MESSAGE_INTERVAL, 105, 4000, 0, 1), Result.FAILED),
        (command(SET_MESSAGE_INTERVAL, 105, 4000, 0, 0, 0, 0, 1), Result.FAILED),
        (command(SET_MESSAGE_INTERVAL, NAN, 4000), Result.FAILED),
        (command(SET_MESSAGE_INTERVAL, 105, NAN), Result.FAILED),
        (command(GET_MESSAGE_INTERVAL, 105), Result.ACCEPTED),
        (command(REQUEST_MESSAGE, 105), Result.ACCEPTED),
        (command(REQUEST_MESSAGE, 9999), Result.DENIED),
        (command(REQUEST_MESSAGE, 244, 105), Result.ACCEPTED),
    ],
)
def test_the_receiver_answers_what_concerns_the_link(asked, result):
    assert commands.receive(asked, StreamsThatKnow105()) == (result, False)


def test_do_set_mode_is_accepted_before_anyone_has_looked_at_it():
    assert commands.receive(command(DO_SET_MODE, 1, 99), StreamsThatKnow105()) == (Result.ACCEPTED, True)


@pytest.mark.parametrize(
    ("target", "ours"),
    [((1, 1), True), ((0, 0), True), ((0, 1), True), ((1, 0), True), ((2, 1), False), ((1, 191), False)],
)
def test_only_what_is_addressed_to_us_is_answered(target, ours):
    assert commands.is_for_us(command(NAV_TAKEOFF, target=target), Identity()) is ours


def test_our_own_echo_is_not_a_command():
    assert not commands.is_for_us(Command(1, 1, 1, 1, NAV_TAKEOFF), Identity())


def test_arming_by_command():
    flight = Flight()
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    assert flight.autopilot.system_status == 4
    assert flight.ask(COMPONENT_ARM_DISARM, 0) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 0) is Result.ACCEPTED
    assert flight.autopilot.system_status == 3


@pytest.mark.parametrize("nonsense", [5.0, -1.0, NAN, math.inf])
def test_a_senseless_arming_parameter_is_not_answered(nonsense):
    flight = Flight()
    assert flight.ask(COMPONENT_ARM_DISARM, nonsense) is None
    assert not flight.autopilot.arming.armed


def test_in_the_air_disarming_needs_the_magic_number():
    flight = Flight()
    flight.ask(NAV_TAKEOFF)
    flight.ask(COMPONENT_ARM_DISARM, 1)
    flight.fly(5.0)
    assert flight.ask(COMPONENT_ARM_DISARM, 0) is Result.TEMPORARILY_REJECTED
    assert flight.autopilot.texts[-1].text == "Disarming denied: not landed"
    assert flight.ask(COMPONENT_ARM_DISARM, 0, 21196) is Result.ACCEPTED
    assert not flight.autopilot.arming.armed


@pytest.mark.parametrize("custom", [(1, 1), (1, 4, 4), (1, 4, 6), (1, 4, 5), (1, 3)])
def test_modes_in_which_nobody_can_arm(custom):
    flight = Flight()
    assert flight.ask(DO_SET_MODE, *custom) is Result.ACCEPTED
    assert flight.autopilot.system_status == 0
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED
    # Force changes nothing
    assert flight.ask(COMPONENT_ARM_DISARM, 1, 21196) is Result.TEMPORARILY_REJECTED


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ((1, 4, 99), "Unsupported auto mode"),
        ((1, 77, 0), "Unsupported main mode"),
        ((0, 6, 0), "Unsupported base mode"),
    ],
)
def test_modes_that_do_not_exist(params, text):
    flight = Flight()
    assert flight.ask(DO_SET_MODE, *params) is Result.TEMPORARILY_REJECTED
    assert flight.autopilot.texts[-1].text == text
