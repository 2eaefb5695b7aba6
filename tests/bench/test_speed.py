"""The calls of an interval in lockstep are counted: a number without noise, which a busy machine does not change."""

import cProfile
import pstats
import shutil
from pathlib import Path

import pytest

from bench.fly.faulted import mission_of
from bench.studies.instructions import counted
from bench.studies.speed import fly, recorded, spread, timed

ROOT = Path(__file__).parents[2]
# A change that costs more is looked at: it is made cheaper, or the count here is renewed.
MOST_MORE = 1.05
HELD_TO = {"sim_vehicle": 116.82, "companion": 245.0, "rebound_cli": 6.14}
HELD_RATIO = {
    "a quiet IMU sample": 2.77,
    "a position": 3.74,
    "an attitude": 2.09,
    "a hit's first sample": 21.0,
    "a second of flight": 1.99,
}


@pytest.fixture(scope="module")
def calls():
    """Of an interval, by package: its own functions, and what they call of Python and other people's."""
    fly()  # what is imported or compiled at first counts for nothing
    with cProfile.Profile() as profile:
        fly()
    found, intervals = dict.fromkeys(HELD_TO, 0), 0
    for (file, _, name), (_, _, _, _, callers) in pstats.Stats(profile).stats.items():
        own = package_of(file)
        for (of, _, _), (count, *_) in callers.items():
            package = own or package_of(of)
            if package in found:
                found[package] += count
        intervals = max(intervals, sum(count for count, *_ in callers.values())) if name == "record" else intervals
    return {package: count / intervals for package, count in found.items()}


def package_of(file):
    path = Path(file)
    return path.relative_to(ROOT).parts[0] if path.is_relative_to(ROOT) and ".venv" not in path.parts else ""


@pytest.mark.slow
@pytest.mark.parametrize(("package", "held"), HELD_TO.items())
def test_no_program_calls_5_per_cent_more_functions_an_interval(calls, package, held):
    # Given the flight of wall.yaml, hit and recovery in it, and what its intervals were last held to
    # When it is flown now, then no part of the loop has become dearer unseen
    assert 0.0 < calls[package] <= MOST_MORE * held, f"{calls[package]:.1f} calls: docs/explanation/performance.md"


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
