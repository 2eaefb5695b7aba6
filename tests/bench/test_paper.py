"""`python -m bench paper`: the verdicts, the studies' arithmetic, the document's map, and a small flight."""

import dataclasses
import re

import numpy as np
import pandas as pd
import pytest

from bench.detectors.config import BaselineMission
from bench.rows.paper import ends_the_one_before, fly, share_received
from bench.studies.paper import command, flights, single
from bench.studies.paper.study import CLAIMS, FAILED, PASSED, claim
from sim_vehicle.airframe import load_built_in
from tests.rebound_cli.command import ROOT

pytestmark = pytest.mark.slow

DOCUMENT = (ROOT / "bench" / "notes" / "paper.md").read_text()


# What the claims' texts are told.
NUMBERS = ("flown", "from_m", "to_m", "rms", "lost", "own", "past", "speed", "sides", "contact", "contact_ms", "least")
NUMBERS += ("mass", "scaled", "on")
AROUND = [name for name, stated in CLAIMS.items() if {"within", "factor"} & {*stated}]


def verdict(name: str, ours: float) -> str:
    """Where eq. 2 or our own v_c says what is expected, 0.7."""
    expected = 0.7 if name in AROUND and "expected" not in CLAIMS[name] else None
    return claim(name, ours, expected, **dict.fromkeys(NUMBERS, 1.0))["verdict"]


@pytest.mark.parametrize("name", AROUND)
def test_a_tolerance_catches_a_wrong_sign_a_factor_of_two_and_what_is_no_number(name):
    expected = float(CLAIMS[name].get("expected", 0.7))
    assert verdict(name, expected) == PASSED
    assert {verdict(name, factor * expected) for factor in (-1.0, 2.0, 0.5, float("nan"))} == {FAILED}


def test_parameter_identification_agrees_with_eq_2():
    assert {row["verdict"] for row in single.ARM.conclude(pd.DataFrame()).rows} == {PASSED}


def test_a_rigid_pulse_is_a_millisecond_and_a_foldable_one_is_fifty_times_longer():
    rigid_one, foldable = single.pulse("rigid", 1.0), single.pulse("foldable", 1.0)
    assert 0.0005 < rigid_one["width_s"] < 0.0011 and 0.0009 < rigid_one["contact_s"] < 0.0011
    # Closed form: b_s l' + k_s l falls to half of b_s v after 37.2 ms.
    assert foldable["width_s"] == pytest.approx(0.0372, abs=0.0005)


def test_the_share_of_a_hit_that_was_received():
    hit = single.head_on(load_built_in("rigid"), 1.0).hit
    hit = dataclasses.replace(hit, contact_at_boot_us=1000.0, ended_at_boot_us=2000.0)
    assert share_received(np.array([4000.0]), 4000, hit) == pytest.approx(1.0)
    assert share_received(np.array([1500.0, 5500.0]), 4000, hit) == pytest.approx(1.0)
    assert share_received(np.array([1250.0, 9250.0]), 4000, hit) == pytest.approx(0.25)
    assert share_received(np.array([8000.0]), 4000, hit) == 0.0


def test_every_flight_states_the_papers_detector_law_and_gain():
    for mission in (flight.mission for study in command.STUDIES for flight in study.flights()):
        assert mission["companion"]["detector"] == "lateral"
        assert mission["recovery"] == {"law": "paper", "gamma": 0.5}
        BaselineMission.model_validate(dict(mission))


def test_the_sample_scenario_agrees_and_a_setpoint_on_the_wrong_side_or_twice_as_far_would_be_red():
    sample = fly(flights.SAMPLE.flights()[0])
    findings = flights.SAMPLE.conclude(pd.DataFrame([sample]))
    assert {row["verdict"] for row in findings.rows} == {PASSED}
    names = {text.get_text() for text in findings.pictures["sample_scenario.png"].legends[0].get_texts()}
    assert {"wall", "setpoint sent", "recovery setpoint (eq. 3)", "first contact", "hit detected"} <= names
    x, (north_m, *beside) = sample["contact_m"][0], sample["setpoint_m"]
    for wrong_m in (north_m - x, 2 * (x - north_m), (x - north_m) / 2):
        moved = sample | {"setpoint_m": [x - wrong_m, *beside]}
        rows = flights.SAMPLE.conclude(pd.DataFrame([moved])).rows
        assert [row["claim"] for row in rows if row["verdict"] == FAILED] == ["setpoint by eq. 3, back from x(t_c)"]


def test_a_guard_that_swings_in_while_the_arms_unfold_ends_the_same_collision():
    # Given a second touch while an arm is folded by 12 mm and the centre moves away
    arriving = single.head_on(load_built_in("rigid"), 1.0).hit
    leaving = dataclasses.replace(arriving, impact_velocity_ned_m_s=(-0.05, 0.0, 0.0))
    # Then it is no second hit; with the arms out, or with the centre moving in, it is one
    assert ends_the_one_before(leaving, 0.012)
    assert not ends_the_one_before(leaving, 0.0) and not ends_the_one_before(arriving, 0.012)


def test_every_symbol_and_equation_is_where_the_document_says():
    def table_of(heading):
        part = DOCUMENT.split(f"## {heading}\n", 1)[1].split("\n#", 1)[0]
        lines = [line for line in part.splitlines() if line.startswith("|")]
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]

    for symbol, _, names, file in table_of("Symbols"):
        text = (ROOT / file.strip("`")).read_text()
        for name in re.findall(r"`(\w+)`", names):
            assert name in text, f"{symbol}: {name} in {file}"
    equations = table_of("Equations")
    assert {row[0][0] for row in equations} == set("123456") - {"5"}  # 4 and 5 are one row
    for equation, function, file, test in equations:
        assert re.search(rf"(def|class) {function.strip('`')}\b", (ROOT / file.strip("`")).read_text()), (
            f"eq. {equation}"
        )
        assert "def test_" in (ROOT / test.strip("`")).read_text()
