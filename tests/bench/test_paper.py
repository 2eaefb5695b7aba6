"""`python -m bench paper`: the verdicts, the studies' arithmetic, the document's map, and a small flight."""

import dataclasses
import re

import numpy as np
import pytest

from bench.cases.walls import approach
from bench.detectors.config import BaselineMission
from bench.fly.cruise import head_on
from bench.main import main
from bench.studies.paper import arm, causes, command, directions, flight_tests, imu_rate, scenarios, single
from bench.studies.paper.claims import CLAIMS, ClaimRow, claim, rows_text
from bench.studies.paper.flights import StudyContact, StudyFlight, StudyResult, fly, share_received
from bench.studies.paper.study import is_lost, sampling_text
from sim_vehicle.airframe import load_built_in
from tests.rebound_cli.command import ROOT

pytestmark = pytest.mark.slow

DOCUMENT = (ROOT / "bench" / "notes" / "paper.md").read_text()


# --- verdicts ---------------------------------------------------------------------------------------------------


# What the claims' texts are told.
NUMBERS = ("flown", "from_m", "to_m", "rms", "lost", "own", "past", "speed", "said", "contact", "contact_ms", "least")
NUMBERS += ("mass", "scaled", "on")
AROUND = [name for name, stated in CLAIMS.items() if {"within", "factor"} & {*stated}]


def beside(name: str, ours: float) -> ClaimRow:
    """Where eq. 2 or our own v_c says what is expected, 0.7."""
    expected = 0.7 if name in AROUND and "expected" not in CLAIMS[name] else None
    return claim(name, ours, expected, **dict.fromkeys(NUMBERS, 1.0))


@pytest.mark.parametrize("name", AROUND)
def test_a_tolerance_catches_a_wrong_sign_and_a_factor_of_two(name):
    expected = float(CLAIMS[name].get("expected", 0.7))
    assert beside(name, expected).agrees
    assert not any(beside(name, factor * expected).agrees for factor in (-1.0, 2.0, 0.5))


def test_limits_are_judged_from_one_side():
    most, least = beside("error of v_c", 0.1), beside("bouncing", 3.0)
    assert most.agrees and least.agrees and (most.tolerance, least.tolerance) == ("at most 0.1", "at least 3")
    assert not beside("error of v_c", 0.101).agrees and not beside("bouncing", 2.0).agrees


def test_a_row_that_is_not_a_number_differs():
    assert not any(beside(name, float("nan")).agrees for name in CLAIMS)


# --- eq. 2 in closed form -----------------------------------------------------------------------------------------


def test_the_closed_form_solves_eq_2():
    response = arm.SpringResponse(30.0, 500.0, 1.4)
    step_s = 1e-5
    for time_s in (0.001, 0.02, 0.05, 0.09):
        (before, _), (now, rate), (after, _) = (response.at(time_s + shift) for shift in (-step_s, 0.0, step_s))
        assert (after - before) / (2 * step_s) == pytest.approx(rate, rel=1e-4, abs=1e-6)
        assert (after - 2 * now + before) / step_s**2 == pytest.approx(-30.0 * rate - 500.0 * now, rel=1e-3)
    assert response.at(0.0) == pytest.approx((0.0, 1.4))
    assert response.at(response.half_period_s)[0] == pytest.approx(0.0, abs=1e-9)
    fold_m, rate_m_s = response.at(response.force_free_s)
    assert 30.0 * rate_m_s + 500.0 * fold_m == pytest.approx(0.0, abs=1e-9)


def test_parameter_identification_agrees_with_eq_2():
    findings = arm.conclude([])
    assert all(row.agrees for row in findings.rows)
    assert {row.claim: row.ours for row in findings.rows}["peak fold at 1.4 m/s, before the stop"] == pytest.approx(
        0.0294, abs=0.0001
    )


# --- what is measured ---------------------------------------------------------------------------------------------


def test_a_rigid_pulse_is_a_millisecond_and_a_foldable_one_is_fifty_times_longer():
    rigid, foldable = single.pulse("rigid", 1.0), single.pulse("foldable", 1.0)
    assert 0.0005 < rigid.width_s < 0.0011 and 0.0009 < rigid.contact_s < 0.0011
    # Closed form: b_s l' + k_s l falls to half of b_s v after 37.2 ms.
    assert foldable.width_s == pytest.approx(0.0372, abs=0.0005)
    assert foldable.deceleration_m_s2.max() == pytest.approx(30.0, rel=0.03)


def test_a_hover_takes_the_stated_share_of_thrust():
    assert single.hover_share(1.0) == pytest.approx(0.70, abs=0.005)
    assert single.hover_share(1.112) / single.hover_share(1.0) == pytest.approx(1.112, abs=0.005)


def hit_between(start_us, end_us):
    (template,) = [head_on(load_built_in("rigid"), 1.0).hit]
    return dataclasses.replace(template, contact_at_boot_us=start_us, ended_at_boot_us=end_us)


def test_the_share_of_a_hit_that_was_received():
    hit = hit_between(1000.0, 2000.0)
    assert share_received(np.array([4000.0]), 4000, hit) == pytest.approx(1.0)
    assert share_received(np.array([1500.0, 5500.0]), 4000, hit) == pytest.approx(1.0)
    assert share_received(np.array([1250.0, 9250.0]), 4000, hit) == pytest.approx(0.25)
    assert share_received(np.array([8000.0]), 4000, hit) == 0.0


# --- the studies --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("study", command.STUDIES)
def test_every_study_states_the_papers_detector_law_and_gain(study):
    for flight in study.flights(2):
        mission = BaselineMission.model_validate(dict(flight.mission))
        assert (mission.companion.detector, mission.recovery.law, mission.recovery.gamma) == ("lateral", "paper", 0.5)
        assert flight.mission["companion"]["detector"] == "lateral"
        assert flight.mission["recovery"] == {"law": "paper", "gamma": 0.5}


def test_directions_fill_the_circle():
    headings = sorted(directions.heading_deg(seed) for seed in range(1, 51))
    assert max(np.diff([*headings, headings[0] + 360.0])) < 15.0
    assert [directions.off_axis_deg(h) for h in (0.0, 90.0, 350.0, 45.0, 280.0)] == [0.0, 0.0, 10.0, 45.0, 10.0]


def test_the_wall_stands_square_to_the_flight_before_braking_begins():
    mission = BaselineMission.model_validate(approach(4.0, heading_deg=120.0))
    go_to, wall = mission.items[1].go_to, mission.sim["walls"][0]
    towards = np.array(go_to.position_ned_m[:2]) / np.hypot(*go_to.position_ned_m[:2])
    assert wall["normal_ned"][:2] == pytest.approx(-towards)
    wall_m, target_m = np.hypot(*wall["point_ned_m"][:2]), np.hypot(*go_to.position_ned_m[:2])
    assert target_m - wall_m > 4.0**2 / (2 * go_to.acceleration_m_s2)


@pytest.fixture(scope="module")
def sample() -> StudyResult:
    return fly(scenarios.SAMPLE.flights(1)[0])


def test_the_sample_scenario_agrees_and_its_picture_marks_everything(sample):
    findings = scenarios.SAMPLE.conclude([sample])
    assert [row.claim for row in findings.rows if not row.agrees] == []
    figure = findings.pictures["sample_scenario.png"]
    names = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"wall", "vehicle's centre", "setpoint sent", "recovery setpoint (eq. 3)", "first contact"} <= names
    assert any(name.startswith("hit detected") for name in names)
    for axis in figure.axes:
        assert re.search(r"\[s\]", axis.get_xlabel()) and re.search(r"\[(m|mm|m/s)\]", axis.get_ylabel())


def test_the_same_flight_gives_the_same_numbers(sample):
    again = fly(scenarios.SAMPLE.flights(1)[0])
    assert again.contacts == sample.contacts and again.imu_received_hz == sample.imu_received_hz


def test_a_setpoint_on_the_wrong_side_or_twice_as_far_would_be_red(sample):
    claim = "setpoint by eq. 3, back from x(t_c)"
    contact = sample.first
    x, y, z = contact.hit.contact_position_ned_m
    back_m, off_m = x - contact.setpoint_in_world_ned_m[0], contact.hit.frame_offset_ned_m[0]
    for wrong_m in (-back_m, 2 * back_m, back_m / 2):
        told = dataclasses.replace(contact.told, recovery_setpoint_ned_m=(x - wrong_m + off_m, y, z))
        moved: StudyContact = dataclasses.replace(contact, told=told)
        rows = scenarios.SAMPLE.conclude([dataclasses.replace(sample, contacts=(moved,))]).rows
        assert [row.claim for row in rows if not row.agrees] == [claim]


def results_like(sample, flights):
    """The sample's result under other flights' names: for what is written, not for what is flown."""
    return [dataclasses.replace(sample, flight=flight) for flight in flights]


def papers_numbers(axis):
    """In each line that is the paper's own: where it is drawn across, or upright."""
    lines = [line for line in axis.get_lines() if line.get_label() == "the paper's own number"]
    return [line.get_ydata()[0] if line.get_ydata()[0] != 0 else line.get_xdata()[0] for line in lines]


def test_the_papers_own_numbers_are_drawn_where_its_text_gives_any(sample):
    position, velocity, _, fold = scenarios.SAMPLE.conclude([sample]).pictures["sample_scenario.png"].axes
    assert papers_numbers(velocity) == [1.4, -0.28] and papers_numbers(fold) == [30.0]
    assert papers_numbers(position) == []
    # 1.05 m back in its simulation, 0.95 m in its experiment, at 2.1 m/s
    pictures = scenarios.EXPERIMENT.conclude(results_like(sample, scenarios.EXPERIMENT.flights(1))).pictures
    position, velocity = pictures["simulation_experiment.png"].axes
    backs_m = [sample.track.touch_m - place_m for place_m in papers_numbers(position)]
    assert backs_m == pytest.approx([1.05, 0.95]) and papers_numbers(velocity) == [2.1]
    # 1 to 2.5 m/s, half of it back in metres
    pictures = flight_tests.conclude(results_like(sample, flight_tests.flights(1))).pictures
    axes = pictures["flight_tests_rigid.png"].axes
    assert sorted({speed for axis in axes[4:] for speed in papers_numbers(axis)}) == [1.0, 1.5, 2.0, 2.5]
    assert papers_numbers(arm.conclude([]).pictures["arm.png"].axes[0]) == [30.0]


@pytest.mark.parametrize("study", [flight_tests, causes, directions, imu_rate, scenarios.EXPERIMENT])
def test_each_study_states_how_the_sensor_was_received(sample, study):
    findings = study.conclude(results_like(sample, study.flights(1)))
    assert findings.rows
    assert re.search(r"HIGHRES_IMU` as received: \d+ Hz, each sample the mean of \S+ ms", sampling_text([sample]))
    assert rows_text(findings.rows).count("\n") == len(findings.rows) + 2


def test_a_vehicle_that_hits_again_or_overshoots_makes_the_directions_red(sample):
    flights = directions.flights(1)
    short, past = (dataclasses.replace(sample.first, overshoot_m=overshoot_m) for overshoot_m in (0.02, 0.2))
    good = [dataclasses.replace(result, contacts=(short,)) for result in results_like(sample, flights)]
    assert all(row.agrees for row in directions.conclude(good).rows)
    bad = [dataclasses.replace(result, recontacts=1, contacts=(past, past)) for result in good]
    assert not any(row.agrees for row in directions.conclude(bad).rows)


def test_a_guard_that_swings_in_while_the_arms_unfold_ends_the_same_collision(sample):
    # Given a second touch while an arm is folded by 12 mm and the centre moves away
    leaving = dataclasses.replace(sample.first.hit, impact_velocity_ned_m_s=(-0.05, 0.0, 0.0))
    touch = dataclasses.replace(sample.first, hit=leaving, fold_before_m=0.012)
    result = dataclasses.replace(sample, recontacts=1, contacts=(sample.first, touch))
    # Then it is no second hit; with the arms out, or with the centre moving in, it is one
    assert result.second_hits == 0
    arriving = dataclasses.replace(touch, hit=sample.first.hit)
    for other in (dataclasses.replace(touch, fold_before_m=0.0), arriving):
        assert dataclasses.replace(result, contacts=(sample.first, other)).second_hits == 1


def test_a_lost_hit_is_told_from_one_that_was_seen(sample):
    assert not is_lost(sample)
    assert is_lost(dataclasses.replace(sample, contacts=(dataclasses.replace(sample.first, share_received=0.05),)))


# --- the document and the command ---------------------------------------------------------------------------------


def table_of(heading: str) -> list[list[str]]:
    """The rows of the table below a heading of the document."""
    part = DOCUMENT.split(f"## {heading}\n", 1)[1].split("\n#", 1)[0]
    lines = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_every_symbol_is_where_the_document_says():
    rows = table_of("Symbols")
    assert len(rows) > 20
    for symbol, _, names, file in rows:
        text = (ROOT / file.strip("`")).read_text()
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"\b{name}\b" if not name.startswith("_") else name, text), f"{symbol}: {name} in {file}"


def test_every_equation_has_its_function_and_its_test():
    rows = table_of("Equations")
    assert {row[0][0] for row in rows} == set("123456") - {"5"}  # 4 and 5 are one row
    for equation, function, file, test in rows:
        text = (ROOT / file.strip("`")).read_text()
        assert re.search(rf"(def|class) {function.strip('`')}\b", text), f"eq. {equation}"
        assert "def test_" in (ROOT / test.strip("`")).read_text()


def test_a_foldable_flight_at_one_metre_per_second_neither_returns_nor_overshoots():
    result = fly(StudyFlight(("quick",), approach(1.0, cruise_s=1.5), "foldable", 1))
    assert len(result.contacts) == 1
    assert result.first.is_detected and result.overshoot_m <= CLAIMS["foldable overshoot"]["most"]
    assert 0.15 < result.first.hit.rebound_speed_m_s / result.first.impact_speed_m_s < 0.3


def test_a_count_that_makes_no_sense_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["paper", "--seeds", "0"])
    assert ended.value.code == 2 and "whole number" in capsys.readouterr().err


@pytest.mark.parametrize(
    "flight", [flight for flight in causes.flights(1) if flight.seed == 1], ids=lambda f: str(f.key)
)
def test_whatever_is_changed_the_vehicle_reaches_its_wall(flight):
    assert fly(dataclasses.replace(flight, is_drawn=False)).contacts
