"""Lockstep as a table and as a conversation, without sockets and on virtual time."""

import pytest

from sim_vehicle.errors import NotInLockstep
from sim_vehicle.hil.exchange import ANSWER_TIMEOUT_US, STARTING_TIMEOUT_US, Exchange, ExchangePhase
from sim_vehicle.hil.messages import MOTORS_STOPPED, ActuatorControls

HALF_THRUST = (0.5, 0.5, 0.5, 0.5)


def answer(time_us: int, armed: bool = True, is_lockstep: bool = True) -> ActuatorControls:
    return ActuatorControls(time_us, armed, is_lockstep, HALF_THRUST)


def starting() -> Exchange:
    return Exchange(0)


def in_lockstep() -> Exchange:
    """PX4 has answered the sample of 4 ms, sent at the machine's time 1000."""
    exchange = starting()
    exchange.sent(4_000, 1_000)
    exchange.received(answer(4_000))
    return exchange


def test_an_answer_to_an_older_sample_gives_its_commands_but_not_the_turn():
    exchange = starting()
    exchange.sent(4_000, 0)
    exchange.sent(8_000, 4_000)
    exchange.received(answer(4_000))
    exchange.sent(12_000, 8_000)
    exchange.received(answer(8_000, armed=False))
    assert exchange.phase is ExchangePhase.AWAITING
    exchange.received(answer(12_000))
    assert exchange.phase is ExchangePhase.READY


def test_a_disarmed_px4_stops_the_motors_whatever_it_says_of_them():
    exchange = in_lockstep()
    exchange.sent(8_000, 0)
    exchange.received(answer(8_000, armed=False))
    assert exchange.motor_fractions == MOTORS_STOPPED


def test_an_answer_that_does_not_come_is_given_up_after_the_timeout_and_told_once():
    exchange = in_lockstep()
    exchange.notices.clear()
    exchange.sent(8_000, 10)
    exchange.look_at_clock(10 + ANSWER_TIMEOUT_US - 1)
    assert exchange.next_sample_at_us() is None
    exchange.look_at_clock(10 + ANSWER_TIMEOUT_US)
    assert exchange.next_sample_at_us() is not None
    exchange.sent(12_000, 20 + ANSWER_TIMEOUT_US)
    exchange.look_at_clock(20 + 2 * ANSWER_TIMEOUT_US)
    assert exchange.overdue_answers == 2
    assert len(exchange.notices) == 1


def test_a_px4_that_never_answers_is_told_of_once():
    exchange = starting()
    for now_us in range(0, STARTING_TIMEOUT_US + 3_000_000, 1_000_000):
        exchange.look_at_clock(now_us)
    assert len(exchange.notices) == 1
    assert "no motor commands" in exchange.notices[0]


@pytest.mark.parametrize("wrong", [answer(4_000, is_lockstep=False), answer(8_000)])
def test_a_px4_with_a_clock_of_its_own_is_refused(wrong):
    exchange = starting()
    exchange.sent(4_000, 0)
    with pytest.raises(NotInLockstep, match="lockstep"):
        exchange.received(wrong)
