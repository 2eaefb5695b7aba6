"""Signals: the first one is a reason to hand the vehicle over, the second ends the program."""

import os
import signal

import pytest

from rebound_cli.live.interrupts import Interrupts


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_is_a_reason_and_the_second_ends_the_program(number):
    before = signal.getsignal(number)
    with Interrupts() as interrupts:
        os.kill(os.getpid(), number)
        assert interrupts.reason is not None and interrupts.reason.startswith("stopped")
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


def test_one_that_is_put_off_may_come_once_more_before_the_next_ends_the_program():
    with Interrupts() as interrupts:
        assert interrupts.news(is_put_off=False) is None
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts.news(is_put_off=False) == "stopped with Ctrl-C"
        assert interrupts.news(is_put_off=True) is None
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts.news(is_put_off=True) == "stopped with Ctrl-C, and once more"
        assert interrupts.news(is_put_off=True) is None
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
