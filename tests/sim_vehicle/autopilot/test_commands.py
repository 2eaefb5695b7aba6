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


@pytest.mark.parametrize(
    ("target", "ours"),
    [((1, 1), True), ((0, 0), True), ((0, 1), True), ((1, 0), True), ((2, 1), False), ((1, 191), False)],
)
def test_only_what_is_addressed_to_us_is_answered(target, ours):
    assert commands.is_for_us(command(NAV_TAKEOFF, target=target), Identity()) is ours


def test_our_own_echo_is_not_a_command():
    assert not commands.is_for_us(Command(1, 1, 1, 1, NAV_TAKEOFF), Identity())


@pytest.mark.parametrize("custom", [(1, 1), (1, 4, 4), (1, 4, 6), (1, 4, 5), (1, 3)])
def test_modes_in_which_nobody_can_arm(custom):
    flight = Flight()
    assert flight.ask(DO_SET_MODE, *custom) is Result.ACCEPTED
    assert flight.autopilot.system_status == 0
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED
    # Force changes nothing
    assert flight.ask(COMPONENT_ARM_DISARM, 1, 21196) is Result.TEMPORARILY_REJECTED
