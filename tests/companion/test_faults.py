"""A fault in the program itself: the vehicle is handed over, and heartbeats, setpoints and events go on until it is."""

import itertools
import math

import pytest

from companion.flight.context import Target
from companion.flight.progress import FlyItems
from companion.reflex import reflex
from tests.companion.fake_vehicle import LOITER, flight, flying_in


class SumError(Exception):
    pass


def breaks(*arguments):
    raise SumError("the sum is not the sum")


def broken_target(self, now_us):
    return Target((float("nan"), 0.0, -1.5), None)


ON_THE_WAY_OUT = ["companion.core.bounded", "companion.core.status_text"]
ON_THE_WAY_OUT += ["companion.mavlink.encode.Encoder._position_fields"]


@pytest.mark.parametrize(
    ("place", "does"),
    [
        ("companion.flight.progress.FlyItems.step", breaks),
        ("companion.flight.progress.FlyItems.target", breaks),
        ("companion.flight.progress.FlyItems.target", broken_target),
        ("companion.reflex.reflex.advance", breaks),
        *((place, breaks) for place in ON_THE_WAY_OUT),
    ],
)
def test_whatever_breaks_in_the_air_hands_the_vehicle_over_by_setpoints_that_are_safe_to_hold(monkeypatch, place, does):
    f = flying_in("mission")
    broken_at_us, safe = f.now_us, f.setpoints_since(0)[-1][1]
    monkeypatch.setattr(place, does)
    f.companion.core.flight.report(f.now_us, "policy", "something to tell")
    f.run_to_end(3.0)

    assert f.report.outcome == "failed"
    assert f.vehicle.mode == LOITER and f.vehicle.armed
    if does is breaks:
        assert "SumError in breaks: the sum is not the sum" in f.report.reason
        assert "test_faults.py" in f.event("fault").data["traceback"]
    times_us = [at_us for at_us, _ in f.setpoints_since(broken_at_us - 100_000)]
    assert max(b - a for a, b in itertools.pairwise(times_us)) <= 50_000, "no gap before the mode is seen to hold"
    assert times_us[-1] > broken_at_us or place in ON_THE_WAY_OUT
    for _, sent in f.setpoints_since(broken_at_us):
        assert math.isfinite(sent.x) and math.isnan(sent.vx) and math.isnan(sent.afx)
        assert math.dist((sent.x, sent.y, sent.z), (safe.x, safe.y, safe.z)) < 0.1, "where the last good one was"


def test_a_fault_on_the_ground_arms_nothing(monkeypatch):
    f = flight(confirmed=False)
    f.run_until(f.companion.plan_is_ready)
    commands = len(f.vehicle.commands)
    monkeypatch.setattr(reflex, "advance", breaks)
    assert f.run_to_end(1.0).outcome == "failed"
    assert len(f.vehicle.commands) == commands and f.vehicle.setpoints == []


def test_when_even_the_hand_over_breaks_silence_leaves_the_vehicle_to_its_failsafe(monkeypatch):
    f = flying_in("mission")
    monkeypatch.setattr(FlyItems, "step", breaks)
    monkeypatch.setattr("companion.flight.ending.HandOver.step", breaks)
    f.run_to_end(1.0)
    since = f.now_us
    f.run_for(2.0)
    assert f.setpoints_since(since) == []
    assert f.kinds().count("fault") == 2
