"""Detectors at the bench: what `fused` is compared with, verdicts on hits, and recorded flights against labels."""

import math
from dataclasses import replace

import pandas as pd
import pytest

from bench.cases.hits import draw_case, vehicle_of_hit
from bench.detectors.config import BaselineConfig
from bench.fly.wire import ASKED_HZ, fly_hit
from bench.main import main
from bench.studies.detection.detectors import first_possible, samples_late
from bench.studies.detection.flights import Event, events, mistakes
from companion.mission.config import CompanionConfig
from companion.motion.vector import ZERO, plus
from companion.reflex.detection.detector import ImpactKind
from rebound_cli.replay.report import replay_log
from tests.companion.reflex.test_collision_monitor import IN_FLIGHT, Watch
from tests.rebound_cli.replay.flying import HIT_US, flight

PUSHED_US, LASTS_US, HERE = 4_000_000, 60_000, (0.0, 0.0, -3.0)


def fly(detector, push_m_s2):
    """Hovering at its setpoint, then pushed, and on by what the push has left of speed."""

    def pushed_s(t):
        return 1e-6 * min(max(t - PUSHED_US, 0), LASTS_US)

    watch = Watch(BaselineConfig(detector=detector)).fly(
        6_000_000,
        push=lambda t: push_m_s2 if PUSHED_US <= t < PUSHED_US + LASTS_US else ZERO,
        velocity=lambda t: plus(ZERO, pushed_s(t), push_m_s2),
        place=lambda t: plus(HERE, pushed_s(t) * (1e-6 * (t - PUSHED_US) - 0.5 * pushed_s(t)), push_m_s2),
        situation=IN_FLIGHT._replace(setpoint_position_ned_m=HERE),
    )
    return watch.impacts


def wall(strength):
    return -strength, 0.0, 0.0


@pytest.mark.parametrize(
    ("detector", "push", "seen"),
    [
        # The fixed threshold is for each axis and not for the magnitude
        ("threshold", (-18.0, 18.0, 0.0), 0),
        ("threshold", wall(21.0), 1),
        # The horizontal one looks sideways alone
        ("fuzzy", (0.0, 0.0, -12.0), 0),
        ("fuzzy", wall(9.6), 0),
        ("fuzzy", wall(10.0), 1),
        ("fuzzy", (0.0, -10.0, 0.0), 1),
        ("lateral", wall(3.6), 0),
        ("lateral", wall(4.4), 1),
    ],
)
def test_a_force_is_a_hit_from_its_threshold_on(detector, push, seen):
    assert len(fly(detector, push)) == seen


@pytest.mark.parametrize("seed", range(10))
def test_a_hit_is_the_one_that_was_asked_for(seed):
    # Given any approach
    case = draw_case(seed, False)
    airframe = vehicle_of_hit(case).airframe
    # When it is flown
    flown = fly_hit(case, airframe)
    # Then the vehicle touches at the speed asked for, moving towards the obstacle
    speed_m_s = sum(v * v for v in flown.hit.impact_velocity_ned_m_s) ** 0.5
    assert speed_m_s == pytest.approx(case.speed_m_s, rel=0.1, abs=0.1)
    # And the recorded contact force adds up to the hit's impulse, and there is none before it
    before = [force for time_us, force in flown.contact_m_s2.items() if time_us < flown.hit.contact_at_boot_us]
    assert before and not any(before)
    total_m_s = sum(flown.contact_m_s2.values()) * 1e-6 * airframe.imu.integration_interval_us
    assert total_m_s >= 0.95 * sum(j * j for j in flown.hit.impulse_ned_n_s) ** 0.5 / airframe.mass_kg


def test_the_first_possible_sample_is_the_first_received_that_holds_the_force():
    # Given a hit, heard at every rate
    case = draw_case(0, False)
    flown = fly_hit(case, vehicle_of_hit(case).airframe)
    touch_us, first_us = flown.hit.contact_at_boot_us, {}
    for rate, arrived in flown.heard.items():
        first_us[rate], times_us = first_possible(flown.contact_m_s2, arrived, touch_us, floor_m_s2=1.5)
        # Then the report that came with it was not late, and one with the next sample was late by one
        after_us = next(time_us for time_us in times_us if time_us > first_us[rate])
        late = [samples_late(at_us, first_us[rate], times_us) for at_us in (first_us[rate], after_us)]
        assert late == [0, 1] and first_us[rate] > touch_us
        # and each rate is the one that a client of PX4 receives
        flown_s = 1e-6 * (times_us[-1] - times_us[0])
        assert (len(times_us) - 1) / flown_s == pytest.approx(rate, rel=0.03)
    # And slower streams show it later or at the same time, up to an interval of the stream
    assert first_us[246] - touch_us <= 8_000
    assert first_us[50] - touch_us <= 24_000
    # And where no force reaches the floor, the hit fell between the samples
    assert first_possible(flown.contact_m_s2, arrived, touch_us, floor_m_s2=1e6)[0] is None


@pytest.mark.slow
def test_the_command_writes_tables_and_rows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["detectors", "--hits", "4", "--jobs", "1", "--out", "page"]) == 0
    text = (tmp_path / "page" / "detectors.md").read_text()
    assert "`python -m bench detectors --hits 4 --jobs 1 --out page`" in text
    assert "## Every detector on simulated hits" in text and "bars are met" in capsys.readouterr().out
    table = pd.read_json(tmp_path / "page" / "detectors.jsonl", lines=True)
    assert {*table["detector"]} >= {"fused", "threshold"} and {*table["rate"]} == {*ASKED_HZ}


def event(at_s, told, late_s=None):
    return Event(at_s, at_s, told, late_s)


def test_a_label_is_met_by_an_event_of_its_class_near_it_that_is_told_in_time():
    found = [event(10.0, "touchdown"), event(20.0, "crash")]
    assert list(mistakes(found, {10.4: "touchdown", 20.9: "crash"})) == []
    assert list(mistakes(found[:1], {10.0: "crash"})) == ["crash at 10.0 s told as touchdown"]
    assert list(mistakes(found[:1], {40.0: "crash"})) == ["crash at 40.0 s told as nothing"]
    # A crash that is told long after its hardest moment is told late
    labels = {10.0: "crash"}
    assert list(mistakes([event(10.0, "crash", late_s=0.1)], labels)) == []
    assert list(mistakes([event(10.0, "crash", late_s=-0.6)], labels)) == []
    assert list(mistakes([event(10.0, "crash", late_s=0.6)], labels)) == ["crash at 10.0 s told 0.60 s late"]


@pytest.mark.parametrize("told", ["collision", "crash"])
def test_a_collision_or_a_crash_without_a_label_is_one_where_nothing_was(told):
    assert list(mistakes([event(10.0, told)], {})) == [f"{told} at 10.0 s, where nothing was"]
    assert list(mistakes([event(10.0, told)], {10.2: "nothing"})) == [f"{told} at 10.0 s, where nothing was"]
    assert list(mistakes([event(10.0, told)], {10.2: told})) == []
    # Landings are many, and nobody labels them all
    assert list(mistakes([event(10.0, "touchdown")], {})) == []


def test_how_late_a_crash_is_told_counts_from_its_hardest_sample():
    replay = replay_log(flight(), CompanionConfig())
    (hit,) = replay.findings.impacts
    assert not hit.is_crash and next(events(replay)).late_s is None
    crash = replace(hit.first, impact=replace(hit.first.impact, kind=ImpactKind.CRASH))
    hardest_us, _ = max(replay.log.imu(), key=lambda item: math.hypot(*item[1].specific_force_frd_m_s2))
    replay.findings.impacts[:] = [replace(hit, at_us=hardest_us + 300_000, first=crash)]
    assert next(events(replay)).late_s == pytest.approx(0.3)


def test_what_follows_within_two_seconds_is_one_event():
    replay = replay_log(flight(), CompanionConfig())
    (hit,) = replay.findings.impacts
    replay.findings.impacts += [replace(hit, at_us=hit.at_us + 1_500_000), replace(hit, at_us=hit.at_us + 4_000_000)]
    replay.findings.happenings.append((hit.at_us + 5_000_000, "crashed: tipped over"))
    first, second = events(replay)
    assert (first.told, second.told) == ("collision", "crash")
    assert first.at_s == pytest.approx(HIT_US * 1e-6, abs=0.01)
    assert first.until_s == pytest.approx(first.at_s + 1.5) and second.until_s == pytest.approx(second.at_s + 1.0)


def test_a_log_that_cannot_be_read_is_named_and_a_folder_without_logs_is_an_error(tmp_path):
    (tmp_path / "empty.bin").write_bytes(b"")
    assert main(["flights", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "the file is empty" in (tmp_path / "out" / "flights.md").read_text()
