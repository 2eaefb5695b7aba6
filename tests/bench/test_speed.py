"""A packet's instructions are counted: a number without noise, which a busy machine does not change."""

import shutil

import pytest

from bench.fly.faulted import mission_of
from bench.studies.instructions import counted
from bench.studies.speed import recorded, spread, timed

# A change that costs more is looked at: it is made cheaper, or the count here is renewed.
MOST_MORE = 1.05
HELD_RATIO = {
    "a quiet IMU sample": 2.77,
    "a position": 3.74,
    "an attitude": 2.09,
    "a hit's first sample": 21.0,
    "a second of flight": 1.99,
}


@pytest.mark.realtime
def test_each_hit_is_answered_long_before_px4_would_miss_a_setpoint():
    # Given a flight that is played to the loop of real flights until its hit (COM_OF_LOSS_T is 1 s)
    taken = list(timed(recorded(mission_of(0)), 3))
    assert all(seconds is not None and 0.0 < seconds < 0.5 for seconds in taken)


def test_a_hit_that_is_not_answered_in_time_counts_among_the_latencies():
    found = spread([0.004, 0.006, None])
    assert (found["setpoints"], found["p50"], found["most"]) == (2, "6.00", "inf")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind counts instructions, and is not installed")
def test_no_packet_takes_5_per_cent_more_instructions():
    # Given what each took last, over pymavlink's parse of the same bytes
    # When they are counted now, then none has become dearer unseen
    found = {row[""]: row["ratio"] for row in counted()}
    assert found.keys() == HELD_RATIO.keys()
    assert {what: ratio for what, ratio in found.items() if ratio > MOST_MORE * HELD_RATIO[what]} == {}
