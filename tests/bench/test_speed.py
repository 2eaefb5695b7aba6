"""The calls of an interval in lockstep are counted: a number without noise, which a busy machine does not change."""

import math

import pytest

from bench.studies.speed.latency import recorded, spread, timed
from bench.studies.speed.parts import PARTS, calls_an_interval, held_to
from bench.studies.speed.study import fly

# A change that costs more is looked at: it is made cheaper, or the count is renewed by `python -m bench speed --calls`.
MOST_MORE = 1.05


@pytest.fixture(scope="module")
def calls():
    fly()  # what is imported or compiled at first counts for nothing
    return calls_an_interval(fly)


@pytest.mark.slow
@pytest.mark.parametrize("program", ["plant", "vehicle", "companion", "log"])
def test_no_program_calls_5_per_cent_more_functions_an_interval(calls, program):
    # Given the flight of wall.yaml, hit and recovery in it, and what its intervals were last held to
    parts = [part.name for part in PARTS if part.name.startswith(program)]
    now, held = (sum(found[name] for name in parts) for found in (calls, held_to()))
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
