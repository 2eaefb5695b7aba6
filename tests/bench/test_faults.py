"""The table of faults: its rows, what it flies, and what it calls a failure."""

import math

import pytest

from bench.campaign.plan import Json
from bench.faults.air import Injector, When
from bench.faults.catalogue import FILES, FLOWN
from bench.faults.envelope import outside
from bench.faults.fault import COMPLETED, Expected, Fault
from bench.faults.files import tried
from bench.faults.flight import fly, fly_from_one_take_off
from bench.faults.injectors import Rewritten, setting
from bench.faults.latency import _spread
from bench.faults.packets import IMU, made
from bench.faults.table import Row, text_of
from tests.companion.hostile import flight_in

SETPOINT = {"x": 1.0, "z": -1.5, "type_mask": 0xDF8}


def test_every_group_has_rows_and_there_are_as_many_as_promised() -> None:
    groups = {fault.group for fault in FLOWN.values()} | {fault.group for fault in FILES.values()}
    assert len(FLOWN) + len(FILES) >= 44 and len(groups) == 10
    assert not {*FLOWN} & {*FILES}


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({}, None),
        ({"x": math.nan}, "not finite"),
        ({"x": 40.0}, "outside the fence"),
        ({"z": 0.5}, "-0.5 m high"),
        ({"type_mask": 0xDC0, "vx": 30.0}, "30.0 m/s"),
        ({"type_mask": 0xC38, "afx": 20.0}, "20.0 m/s2 sideways"),
        ({"type_mask": 0x9F8, "yaw": 4.0}, "yaw 4 rad"),
    ],
)
def test_what_lies_outside_the_envelope_is_named(fields: dict[str, float], wrong: str | None) -> None:
    core = flight_in("mission").companion.core
    assert core is not None
    assert outside(core, made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT | fields)) == wrong


def test_flights_part_at_the_first_item_and_each_has_its_own_fault() -> None:
    # Given a sensor that says nothing true any more, and nothing at all
    blind = Fault(
        "blind", "sensors", "", lambda _: Rewritten(When("mission"), (IMU,), setting(xgyro=math.nan)), Expected()
    )
    calm = Fault("calm", "link", "", lambda _: Injector(), Expected((COMPLETED,)))
    # When both fly on from one take-off
    results: dict[str, Json] = {}
    fly_from_one_take_off(7, [blind, calm], results.__setitem__)
    # Then the hit is found by the one that could, and the other is told as what it is
    assert results["calm"]["found"] and results["calm"]["complaints"] == []
    assert not results["blind"]["found"] and "hit not found" in results["blind"]["complaints"]


def test_a_killed_companion_leaves_a_vehicle_that_lands_and_a_log() -> None:
    results: dict[str, Json] = {}
    fly_from_one_take_off(8, [FLOWN["SIGKILL in a recovery"]], results.__setitem__)
    (result,) = results.values()
    assert result["outcome"] == "killed" and result["complaints"] == [] and result["ground_m_s"] < 1.2


def test_a_pilot_who_takes_over_in_the_climb_is_left_alone() -> None:
    result = fly(9, FLOWN["takes over in take-off"])
    assert result["outcome"] == "aborted" and result["complaints"] == [] and result["after_told"] == 0


@pytest.mark.parametrize("name", ["YAML bomb", "obstacle file cut", "tlog torn", "noise as mission"])
def test_files_that_mean_harm_are_refused_in_words(name: str) -> None:
    assert tried(FILES[name], 3)["complaints"] == []


def test_the_table_counts_what_was_not_as_expected() -> None:
    good = {"complaints": [], "outcome": "read", "seconds": 0.1}
    bad = good | {"complaints": ["taken as good"], "seconds": 2.5}
    text = text_of([Row(FILES["YAML bomb"], [good, bad])], None, 2, "1.0")
    assert "1 faults, 2 flights and files; 0 rows as expected in every one, 1 not." in text
    assert "| 2 | read 2 | 2.5 s of processor time | **1 of 2 not** |" in text
    assert "- **YAML bomb**, 1 of 2:\n  - 1 × taken as good" in text


def test_a_hit_that_is_not_answered_in_time_counts_among_the_latencies() -> None:
    spread = _spread([0.004, 0.006, None])
    assert (spread["found"], spread["p50"], spread["most"]) == (2, 6.0, math.inf)
    text = text_of([], {"hits": 3, "load": 1.0, "busy": spread, "quiet": spread}, 1, "1.0")
    assert "| p50 6.0 ms, p99 more than 500 ms, p99.9 more than 500 ms, most more than 500 ms | 2 of 3 |" in text
