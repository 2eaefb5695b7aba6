"""Detections beside contacts, by the definitions of docs/reference/summary.md."""

from dataclasses import replace

import numpy as np
import pytest

from rebound_cli.results.summary import FlightFacts, Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from tests.bench.random_missions import made_up
from tests.bench.random_missions.made_up import EPOCH_US

SETTLED_S = 0.5


def hit(start_ms, end_ms=None):
    ended_us = 1e3 * (end_ms if end_ms is not None else start_ms + 30)
    made = made_up.hit(1e-3 * start_ms, place=(3.8, 0.0, -1.5))
    return replace(made, ended_at_boot_us=ended_us, rebound_velocity_ned_m_s=(-0.3, 0.0, 0.1))


def collision(sample_ms, settled_after_s=2.0):
    made = made_up.collision(1e-3 * sample_ms, (2.8, 0.0, -1.5), settled_after_s)
    return replace(made, detected_at_us=made.detected_at_us + 500)


def counts(collisions, hits):
    matches = match_contacts(collisions, hits, SETTLED_S)
    return matches.false_detections, matches.missed_contacts, matches.recontacts


@pytest.mark.parametrize(
    ("collisions", "hits", "expected"),
    [
        pytest.param([collision(10_004)], [hit(10_000)], (0, 0, 0), id="seen"),
        pytest.param([collision(9_996)], [hit(10_000)], (1, 1, 0), id="a sample that ends before contact is false"),
        pytest.param([collision(10_128)], [hit(10_000, 10_030)], (0, 0, 0), id="velocities just after may show it"),
        pytest.param([collision(10_132)], [hit(10_000, 10_030)], (1, 1, 0), id="a sample long after is false"),
        pytest.param([collision(10_004), collision(10_020)], [hit(10_000)], (1, 0, 0), id="one contact, one detection"),
        pytest.param([], [hit(10_000)], (0, 1, 0), id="missed"),
        pytest.param([], [hit(10_000), hit(10_500)], (0, 2, 1), id="after a missed contact the next is a recontact"),
        pytest.param(
            [collision(10_004, None), collision(10_504)], [hit(10_000), hit(10_500)], (0, 0, 1), id="before recovery"
        ),
        pytest.param(
            [collision(10_004, 2.0), collision(12_404)], [hit(10_000), hit(12_400)], (0, 0, 1), id="not yet called"
        ),
        pytest.param(
            [collision(10_004, 2.0), collision(12_604)], [hit(10_000), hit(12_600)], (0, 0, 0), id="after recovery"
        ),
    ],
)
def test_what_counts(collisions, hits, expected):
    assert counts(collisions, hits) == expected


def path_of(rows):
    times_s, north_m, down_m = np.array(rows, dtype=float).T
    position = np.column_stack([north_m, np.zeros(len(rows)), down_m])
    return {"time_boot_us": 1e6 * times_s, "position_ned_m": position}


FACTS = FlightFacts("wall", "foldable", 3, SETTLED_S)


def test_the_summary_measures_overshoot_and_height_away_from_the_wall():
    # Given a flight whose path passes the setpoint at 2.8 m north by 4 cm and sinks by 3 cm before it is recovered
    path = path_of([(9.9, 3.7, -1.6), (10.0, 3.8, -1.5), (11.0, 3.0, -1.47), (12.0, 2.76, -1.5), (12.6, 2.0, -1.0)])
    truth = FlightTruth([hit(10_000)], path, EPOCH_US)
    # When it is summed up, of a companion that began a second later than the vehicle
    report = replace(made_up.report(collision(10_004)), started_at_us=EPOCH_US + 1_000_000)
    summary = build_summary(Flown(report, 0.5, truth), FACTS)
    # Then what came after the recovery does not count, and times are seconds since the start
    entry = summary["collisions"][0]
    assert entry["truth"]["overshoot_m"] == pytest.approx(0.04)
    assert entry["truth"]["height_lost_m"] == pytest.approx(0.03)
    assert entry["truth"]["contact_at_s"] == pytest.approx(9.0)
    assert entry["truth"]["detection_latency_ms"] == pytest.approx(4.5)
    assert entry["truth"]["rebound_speed_m_s"] == pytest.approx(0.3)
    assert entry["detected_at_s"] == pytest.approx(9.0045)
    assert (summary["duration_s"], summary["realtime_factor"]) == (16.0, 32.0)
    # and a simulator that stands still for half a second, 0.4 s after the contact, changes none of it
    truth = FlightTruth([hit(10_000)], path, EPOCH_US + 500_000, stalls=[(10_400_000, 500_000)])
    assert build_summary(Flown(report, 0.5, truth), FACTS) == summary


def test_a_setpoint_lies_in_the_frame_that_the_vehicle_believed_in_at_the_contact():
    # Given the same path, of a vehicle that believed itself 0.3 m further north than it was when it touched
    path = path_of([(10.0, 3.8, -1.5), (11.0, 3.0, -1.5), (12.0, 2.46, -1.5)])
    drifted = replace(hit(10_000), frame_offset_ned_m=(0.3, 0.1, 0.0))
    summary = build_summary(
        Flown(made_up.report(collision(10_004)), 0.5, FlightTruth([drifted], path, EPOCH_US)), FACTS
    )
    # Then its setpoint of 2.8 m was at 2.5 m, 1.3 m off the wall, which faces south; and it went 4 cm past that
    found = summary["collisions"][0]["truth"]
    assert (found["overshoot_m"], found["stopped_off_m"]) == pytest.approx((0.04, 1.3))


def test_a_recovery_that_a_next_hit_cuts_short_is_measured_up_to_it():
    # Given a hit that was not recovered from when another was detected 1 s later, and a way past the setpoint then
    path = path_of([(10.0, 3.8, -1.5), (10.9, 3.0, -1.48), (11.5, 2.5, -1.2), (12.0, 2.5, -1.2)])
    truth = FlightTruth([hit(10_000), hit(11_000)], path, EPOCH_US)
    # When it is summed up
    summary = build_summary(Flown(made_up.report(collision(10_004, None), collision(11_004)), 0.5, truth), FACTS)
    # Then the first hit has neither that overshoot nor that loss of height; the second has both
    first, second = (entry["truth"] for entry in summary["collisions"])
    assert (first["overshoot_m"], first["height_lost_m"]) == pytest.approx((0.0, 0.02))
    assert (second["overshoot_m"], second["height_lost_m"]) == pytest.approx((0.3, 0.3))


def test_without_truth_nothing_is_counted_and_without_a_contact_zero():
    summary = build_summary(Flown(made_up.report(collision(10_004)), 25.0, None), FlightFacts("wall", None, None, 0.5))
    unknown = ("false_detections", "missed_contacts", "recontacts", "seed", "airframe")
    assert [summary[key] for key in unknown] == [None] * 5
    assert summary["collisions"][0]["truth"] is None

    truth = FlightTruth([], path_of([(10.0, 0.0, 0.0)]), EPOCH_US)
    summary = build_summary(Flown(made_up.report(), 0.5, truth), FACTS)
    assert [summary[key] for key in ("false_detections", "missed_contacts", "recontacts")] == [0, 0, 0]
