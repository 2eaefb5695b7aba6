"""`rebound tune`: margins by running the detector, settings to use."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from companion.messages import LocalPosition
from rebound_cli.inputs import load_mission_document, mission_from
from rebound_cli.main import main
from rebound_cli.replay import tune as tuning
from rebound_cli.replay.tune import RESERVE, advise, margins
from rebound_cli.replay.watching import watch_log
from tests.rebound_cli.command import WALL
from tests.rebound_cli.logs.ulog_file import every, sensor_combined, ulog
from tests.rebound_cli.replay.flying import LATERAL, flight


def test_a_margin_is_the_largest_sign_of_a_hit_over_the_threshold():
    # Given a healthy flight with one jolt of 2 m/s^2, where 4 is the threshold and noise of 0.3 times 6 is below it
    log = flight(push_m_s2=2.0)
    (margin,) = margins([log], LATERAL)
    assert (margin.setting, margin.share) == ("threshold_m_s2", pytest.approx(2.0 / 4.0, abs=0.15))
    # Then what needs no change stays as it was; without a jolt it is far from the threshold
    value, reason = advise([log], LATERAL, [margin]).settings["lateral", "threshold_m_s2"]
    assert value == 4.0 and "as it was" in reason
    assert [margin.share for margin in margins([flight(hit_us=None)], LATERAL)] == [None]


def test_a_threshold_that_a_healthy_flight_crosses_is_raised_with_a_reserve():
    log = flight(push_m_s2=6.0)
    assert watch_log(log, LATERAL).collisions
    found = margins([log], LATERAL)
    advice = advise([log], LATERAL, found)
    value, _ = advice.settings["lateral", "threshold_m_s2"]
    assert value == pytest.approx(RESERVE * 6.0, rel=0.15)
    assert advice.false_alarms_left == 0
    assert watch_log(log, advice.config).collisions == []


def healthy_log(path, duration_s):
    """A PX4 log of a flight at 200 Hz: armed, up after a second, shaking with 0.3 m/s^2."""
    random = np.random.default_rng(3)
    times = every(5000, 0, round(duration_s * 1e6))
    noise = dict(zip(times, random.normal(0.0, 0.3, (len(times), 3)).tolist(), strict=True))
    force = lambda t: (noise[t][0], noise[t][1], noise[t][2] - 9.8)  # noqa: E731
    topics = {
        "sensor_combined": sensor_combined(times, force),
        "vehicle_land_detected": ("landed", [(0, True), (1_000_000, False)]),
        "vehicle_status": ("nav_state arming_state failsafe", [(0, 14, 2, False)]),
    }
    path.write_bytes(ulog(topics))
    return path


def tune(capsys, *arguments):
    code = main(["tune", *map(str, arguments)])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_the_settings_written_are_what_fly_reads(tmp_path, capsys):
    log, out = healthy_log(tmp_path / "healthy.ulg", 20.0), tmp_path / "mine.yaml"
    code, text, _ = tune(capsys, log, "--out", out)
    assert code == 0
    assert "no false alarm, never blind" in text and "19 s in the air" in text
    # Then the file says what was printed, every number with its reason above it
    content = out.read_text()
    assert content.strip() in text
    settings = yaml.safe_load(content)["companion"]
    assert settings["estimate"]["imu_averaging_interval_s"] == 0.005
    numbers = [line for line in content.splitlines() if line.startswith("    ") and ":" in line and "#" not in line]
    reasons = [line for line in content.splitlines() if line.strip().startswith("#") and line.startswith("    ")]
    assert len(numbers) == len(reasons) >= 3
    # And a mission takes it in place of its own
    mission = mission_from(load_mission_document(WALL, (), companion=out))
    assert mission.companion.model_dump(exclude_unset=True) == settings
    # And it is not overwritten
    code, _, error = tune(capsys, log, "--out", out)
    assert code == 1 and "exists already" in error


def test_what_the_file_to_begin_with_says_of_other_things_is_kept(tmp_path, capsys):
    begin, out = tmp_path / "begin.yaml", tmp_path / "mine.yaml"
    begin.write_text("companion: {detector: fused, fused: {side_threshold_m_s2: 8.0}, link: {silence_s: 2.5}}")
    assert tune(capsys, healthy_log(tmp_path / "healthy.ulg", 20.0), "--companion", begin, "--out", out)[0] == 0
    settings = yaml.safe_load(out.read_text())["companion"]
    assert settings["link"] == {"silence_s": 2.5} and settings["fused"]["side_threshold_m_s2"] == 8.0


def test_logs_that_teach_nothing_are_refused(tmp_path, capsys):
    code, text, error = tune(capsys, healthy_log(tmp_path / "short.ulg", 6.0))
    assert code == 1 and text == "" and "too short a flight to learn from, 5 s in the air" in error


def falling(log):
    """From 2 s on it climbs for two seconds at 5 m/s, then it comes down as fast: at 6 s it is at the ground."""

    def moved(item):
        if not isinstance(item.sample, LocalPosition):
            return item
        climbed_s = max(2.0 - abs(4.0 - item.at_us * 1e-6), 0.0)
        sinks_m_s = 0.0 if climbed_s == 0.0 else 5.0 if item.at_us > 4_000_000 else -5.0
        position, velocity = (0.0, 0.0, -5.0 * climbed_s), (0.0, 0.0, sinks_m_s)
        return replace(item, sample=replace(item.sample, position_ned_m=position, velocity_ned_m_s=velocity))

    return replace(log, heard=tuple(map(moved, log.heard)))


def test_a_crash_and_our_own_flight_with_a_hit_are_refused(wall_flight, monkeypatch, capsys):
    monkeypatch.setattr(tuning, "read_log", lambda _: falling(flight(push_m_s2=60.0)))
    code, text, error = tune(capsys, "crashed.ulg")
    assert code == 1 and text == "" and "not a healthy flight, it crashed at 6.0 s" in error
    monkeypatch.undo()
    code, text, error = tune(capsys, wall_flight[0])
    assert code == 1 and text == "" and "its summary tells 1 collision;" in error
