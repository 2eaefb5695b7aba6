"""`rebound tune`: margins by running the detector, hits of the arm model in a vehicle's own noise, settings to use."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from companion.messages import Attitude, Heartbeat, ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.inputs import load_mission_document, mission_from
from rebound_cli.logs.log import LoggedSample
from rebound_cli.main import main
from rebound_cli.replay.watching import watch_log
from rebound_cli.tune.command import crash
from rebound_cli.tune.hits import (
    SPEEDS_M_S,
    STEP_S,
    HitSensitivity,
    hit_moments,
    impulse_since_touch,
    sensitivity,
    with_hits,
)
from rebound_cli.tune.settings import RESERVE, advise, margins, settings_text
from sim_vehicle.airframe import load_built_in
from tests.rebound_cli.command import WALL
from tests.rebound_cli.logs.ulog_file import every, sensor_combined, ulog
from tests.rebound_cli.replay.flying import LATERAL, flight

FOLDABLE, RIGID = load_built_in("foldable"), load_built_in("rigid")
UNSEEN = HitSensitivity("foldable", 250.0, 10, (0,) * len(SPEEDS_M_S))


def shares(log):
    return {margin.setting: margin.share for margin in margins([log], LATERAL)}


def test_a_margin_is_the_largest_sign_of_a_hit_over_the_threshold():
    # Given a healthy flight with one jolt of 3 m/s^2, where 4 is the threshold and noise of 0.3 times 6 is below it
    found = shares(flight(push_m_s2=3.0))
    assert found["threshold_m_s2"] == pytest.approx(3.0 / 4.0, abs=0.15)
    # and lowering the factor alone changes nothing
    assert found["noise_factor"] is None


def test_a_flight_without_jolts_is_far_from_the_threshold():
    assert shares(flight(hit_us=None)) == {"threshold_m_s2": None, "noise_factor": None}


def test_a_threshold_that_a_healthy_flight_crosses_is_raised_with_a_reserve():
    log = flight(push_m_s2=6.0)
    assert watch_log(log, LATERAL).collisions
    found = margins([log], LATERAL)
    advice = advise([log], LATERAL, found, [UNSEEN])
    value, _ = advice.settings["lateral", "threshold_m_s2"]
    assert value == pytest.approx(RESERVE * 6.0, rel=0.15)
    assert advice.settings["lateral", "noise_factor"][0] == LATERAL.lateral.noise_factor
    assert advice.false_alarms_left == 0
    assert watch_log(log, advice.config).collisions == []


def test_what_needs_no_change_stays_as_it_was():
    log = flight(push_m_s2=2.0)
    advice = advise([log], LATERAL, margins([log], LATERAL), [UNSEEN])
    value, reason = advice.settings["lateral", "threshold_m_s2"]
    assert value == 4.0 and "as it was" in reason


def test_a_hit_of_the_arm_model_begins_with_its_damper_and_gives_back_a_fifth():
    # The paper's eq. 2 with b_s = 30 1/s: 30 m/s^2 at 1 m/s; its damping ratio 0.67 rebounds at 0.22 of the speed
    taken = impulse_since_touch(FOLDABLE, 1.0)
    assert taken[1] / STEP_S == pytest.approx(30.0, rel=0.01)
    assert taken[-1] == pytest.approx(1.22, abs=0.03)
    # A frame that does not fold bounces as its file says
    stop, taken = RIGID.arms.stop, impulse_since_touch(RIGID, 0.01)
    assert taken[-1] == pytest.approx(0.01 * (1.0 + stop.restitution), rel=0.03)
    assert len(taken) * STEP_S == pytest.approx(stop.contact_time_s, rel=0.1)
    # and beyond its range the sensor shows no more than that
    shown = impulse_since_touch(RIGID, 1.0)
    assert np.diff(shown).max() / STEP_S == pytest.approx(RIGID.imu.accelerometer_range_m_s2)
    assert shown[-1] < 0.2


def test_hits_put_into_a_flight_leave_their_whole_impulse_in_its_samples():
    log, impulse = flight(hit_us=None), impulse_since_touch(FOLDABLE, 1.0)
    moments = list(hit_moments(log))
    assert moments and all(2e6 < moment < 10e6 for moment in moments)
    before = np.array([sample.specific_force_frd_m_s2 for _, sample in log.imu()])
    after = np.array([sample.specific_force_frd_m_s2 for _, sample in with_hits(log, moments, impulse).imu()])
    pushed = np.hypot(*(after - before)[:, :2].T)
    assert pushed.sum() * 0.004 == pytest.approx(len(moments) * impulse[-1], rel=0.01)
    assert (after[:, 2] == before[:, 2]).all()


def test_a_low_pass_filter_shows_a_hit_late_and_for_longer():
    # Given samples behind a filter of 20 Hz, and a hit of 1 m/s within a step
    log = replace(flight(hit_us=None), low_pass_hz=20.0)
    (moment, *_) = hit_moments(log)
    after = with_hits(log, [moment], np.array([0.0, 1.0])).imu()
    pushed = [
        (at_us - moment, math.dist(one.specific_force_frd_m_s2, other.specific_force_frd_m_s2))
        for (at_us, one), (_, other) in zip(after, log.imu(), strict=True)
    ]
    # Then its peak is 57 m/s^2, 8.8 ms after the hit, to half a sample's interval
    at_us, peak_m_s2 = max(pushed, key=lambda item: item[1])
    assert at_us == pytest.approx(8_800, abs=2_000)
    assert peak_m_s2 == pytest.approx(57.0, rel=0.05)


def test_a_contact_shorter_than_the_streams_interval_is_missed_now_and_then():
    log = replace(flight(duration_s=14.0, hit_us=None), averaging_us=4000.0)
    folding = [sensitivity([log], LATERAL, FOLDABLE, rate_hz) for rate_hz in (None, 50.0)]
    stiff = [sensitivity([log], LATERAL, RIGID, rate_hz) for rate_hz in (None, 50.0)]
    assert stiff[0].certain_from_m_s == SPEEDS_M_S[0]
    assert stiff[1].certain_from_m_s is None and 0 < stiff[1].seen[-1] < stiff[1].hits
    # Arms that fold push for longer: what the fast stream sees of them, the slow one mostly does, too
    assert folding[0].certain_from_m_s <= 0.5
    assert folding[1].seen[4] == folding[1].hits


def healthy_log(path, duration_s, falls=False):
    """A PX4 log of a flight at 200 Hz: armed, up after a second, shaking with 0.3 m/s^2. `falls`: at 5 s, for 0.5 s."""
    random = np.random.default_rng(3)
    times = every(5000, 0, round(duration_s * 1e6))
    noise = dict(zip(times, random.normal(0.0, 0.3, (len(times), 3)).tolist(), strict=True))
    weight = lambda t: 0.0 if falls and 5_000_000 <= t < 5_500_000 else -9.8  # noqa: E731
    force = lambda t: (noise[t][0], noise[t][1], weight(t) + noise[t][2])  # noqa: E731
    topics = {
        "sensor_combined": sensor_combined(times, force),
        "vehicle_land_detected": ([("bool", "landed")], [(0, True), (1_000_000, False)]),
        "vehicle_status": (
            [("uint8_t", "nav_state"), ("uint8_t", "arming_state"), ("bool", "failsafe")],
            [(0, 14, 2, False)],
        ),
    }
    path.write_bytes(ulog(topics))
    return path


def tune(capsys, *arguments):
    code = main(["tune", *map(str, arguments)])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_the_settings_written_are_what_fly_reads(tmp_path, capsys):
    log, out = healthy_log(tmp_path / "healthy.ulg", 12.0), tmp_path / "mine.yaml"
    code, text, _ = tune(capsys, log, "--detector", "fused", "--airframe", "foldable", "--out", out)
    assert code == 0
    assert "no false alarm, never blind" in text and "under way" in text
    # Then the file says what was printed, every number with its reason above it
    content = out.read_text()
    assert content.strip() in text
    settings = yaml.safe_load(content)["companion"]
    assert settings["estimate"]["imu_averaging_interval_s"] == 0.005
    numbers = [line for line in content.splitlines() if line.startswith("    ") and ":" in line and "#" not in line]
    reasons = [line for line in content.splitlines() if line.strip().startswith("#") and line.startswith("    ")]
    assert len(numbers) == len(reasons) >= 4
    # And a mission takes it in place of its own
    mission = mission_from(load_mission_document(WALL, (), companion=out))
    assert mission.companion.model_dump(exclude_unset=True) == settings
    # And it is not overwritten
    code, _, error = tune(capsys, log, "--out", out)
    assert code == 1 and "exists already" in error


def test_figures_for_a_program(tmp_path, capsys):
    log = healthy_log(tmp_path / "healthy.ulg", 12.0)
    begin = tmp_path / "begin.yaml"
    begin.write_text("companion: {detector: fused, fused: {side_threshold_m_s2: 8.0}, link: {silence_s: 2.5}}")
    code, text, _ = tune(capsys, log, "--companion", begin, "--airframe", "foldable", "--json")
    found = json.loads(text)
    assert code == 0
    assert found["flights"][0]["noise_rms_frd_m_s2"]["under way"] == pytest.approx([0.3] * 3, rel=0.1)
    assert {"setting": "side_threshold_m_s2", "value": 8.0, "share": None} in found["margins"]
    places = {setting["place"]: setting["value"] for setting in found["settings"]}
    # What the file to begin with says of other things is kept
    assert places["companion.link.silence_s"] == 2.5
    assert places["companion.fused.side_threshold_m_s2"] == 8.0


def test_logs_that_teach_nothing_are_refused(tmp_path, capsys):
    for duration_s, words in ((3.0, "no flight in it"), (6.0, "too short a flight")):
        code, text, error = tune(capsys, healthy_log(tmp_path / f"{duration_s}.ulg", duration_s))
        assert code == 1 and text == "" and words in error, error
    code, _, error = tune(capsys, healthy_log(tmp_path / "long.ulg", 10.0), "--detector", "magic")
    assert code == 1 and "there is no detector 'magic'" in error


def fallen(log):
    """From 5 s on it shows no force for half a second."""
    heard = [
        replace(item, sample=replace(item.sample, specific_force_frd_m_s2=(0.3, 0.2, -1.0)))
        if isinstance(item.sample, ImuSample) and 5_000_000 <= item.at_us < 5_500_000
        else item
        for item in log.heard
    ]
    return replace(log, heard=tuple(heard))


def leaning(log, degrees):
    """From 5 s on it leans so far to the right."""
    half_rad = math.radians(degrees) / 2
    attitude = Attitude(5_000_000, (math.cos(half_rad), math.sin(half_rad), 0.0, 0.0))
    heard = sorted([*log.heard, LoggedSample(5_000_000, attitude)], key=lambda item: item.at_us)
    return replace(log, heard=tuple(heard))


def test_a_flight_that_tipped_over_or_fell_is_no_healthy_one():
    healthy = flight(hit_us=None)
    assert crash(healthy) is None
    assert crash(leaning(healthy, 50.0)) is None
    assert crash(leaning(healthy, 111.0)) == "it tipped to 111 degrees at 5.0 s"
    assert crash(fallen(healthy)) == "it fell at 5.0 s"
    # Carried by hand or taken apart on the bench, it may lie on its back
    beats = [
        replace(h, sample=replace(h.sample, armed=False)) for h in healthy.heard if isinstance(h.sample, Heartbeat)
    ]
    disarmed = (*beats, *(item for item in healthy.heard if not isinstance(item.sample, Heartbeat)))
    assert crash(leaning(replace(healthy, heard=disarmed), 111.0)) is None


def test_a_crash_and_our_own_flight_with_a_hit_are_refused(wall_flight, tmp_path, capsys):
    log = healthy_log(tmp_path / "healthy.ulg", 12.0, falls=True)
    code, text, error = tune(capsys, log)
    assert code == 1 and text == "" and "not a healthy flight, it fell at 5.0 s" in error
    code, text, error = tune(capsys, wall_flight[0])
    assert code == 1 and text == "" and "its summary tells 1 collision;" in error


def test_every_detectors_settings_can_be_written():
    config = CompanionConfig()
    log = flight(hit_us=None)
    text = settings_text(advise([log], config, margins([log], config), [UNSEEN]), "x.ulg")
    assert CompanionConfig.model_validate(yaml.safe_load(text)["companion"]).detector == config.detector
