"""The calls of an interval in lockstep are counted: a number without noise, which a busy machine does not change."""

import math

import pytest

from bench.studies.speed.latency import recorded, spread, timed
from bench.studies.speed.parts import calls_an_interval
from bench.studies.speed.study import fly

# A change that costs more is looked at: it is made cheaper, or the count here is renewed.
MOST_MORE = 1.05
HELD_TO = {"plant": 8.0, "vehicle": 118.08, "companion": 328.21, "log": 16.98}


@pytest.fixture(scope="module")
def calls():
    fly()  # what is imported or compiled at first counts for nothing
    return calls_an_interval(fly)


@pytest.mark.slow
@pytest.mark.parametrize(("program", "held"), HELD_TO.items())
def test_no_program_calls_5_per_cent_more_functions_an_interval(calls, program, held):
    # Given the flight of wall.yaml, hit and recovery in it, and what its intervals were last held to
    now = sum(count for part, count in calls.items() if part.startswith(program))
    # When it is flown now, then no part of the loop has become dearer unseen
    assert 0.0 < now <= MOST_MORE * held, f"{now:.1f} calls, held to {held:.1f}: docs/explanation/performance.md"


@pytest.mark.realtime
def test_each_hit_is_answered_long_before_px4_would_miss_a_setpoint():
    # Given a flight that is played to the loop of real flights until its hit (COM_OF_LOSS_T is 1 s)
    taken = list(timed(recorded(0), 3))
    assert all(seconds is not None and 0.0 < seconds < 0.5 for seconds in taken)


def test_a_hit_that_is_not_answered_in_time_counts_among_the_latencies():
    found = spread([0.004, 0.006, None])
    assert (found["found"], found["p50"], found["most"]) == (2, 6.0, math.inf)
