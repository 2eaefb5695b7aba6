"""`rebound replay` and `tune`: each decision again, to the bit; logs through the watch; margins and settings to use."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from companion import messages
from companion.mavlink.packet import message_id_of
from companion.messages import Attitude, ExtendedState, ImuSample, LandedState, LocalPosition, PositionTarget
from companion.mission.config import CompanionConfig
from companion.reflex.config import LIES_US
from companion.reflex.detection.detector import ImpactKind, Situation
from companion.shell.tlog import read_tlog
from rebound_cli.inputs.inputs import load_mission_document, mission_from
from rebound_cli.logs.log import LoggedSample
from rebound_cli.main import main
from rebound_cli.replay import tune as tuning
from rebound_cli.replay.recording import read_recording, reproduce
from rebound_cli.replay.tune import RESERVE, advise, margins
from rebound_cli.replay.watching import Circumstances, watch_log
from tests.rebound_cli.command import WALL, assert_comes_again
from tests.rebound_cli.logs.test_ulog import every, sensor_combined, ulog
from tests.rebound_cli.replay.flying import HIT_US, LATERAL, SECOND, beat, flight, position


def said(capsys, *words):
    code = main([*map(str, words)])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_a_lockstep_flight_is_decided_again_to_the_bit(wall_folder, tmp_path, capsys):
    code, text, _ = said(capsys, "replay", wall_folder, "--expect", "1", "--out", tmp_path)
    assert code == 0
    assert "identical: every decision of the flight came again to the bit" in text
    assert "1 collision" in text
    # With its page, and with the flight's own times
    (page,) = tmp_path.iterdir()
    assert page.name == "report.html" and f"page: {page}" in text
    (hit,) = json.loads((wall_folder / "summary.json").read_text())["collisions"]
    assert f"{hit['detected_at_s']:.3f} s  HIT" in text and "contact, no collision: landing" in text
    # And an expectation that fails is exit code 1
    code, text, _ = said(capsys, "replay", wall_folder, "--expect", "none", "--out", tmp_path)
    assert code == 1 and "expected no collisions, found 1" in text


def test_what_only_holds_a_vehicle_is_a_collision_of_the_replay_too(tmp_path, capsys):
    # Given a vehicle that leans on a wall which it met at 0.06 m/s
    crawl = {"go_to": {"position_ned_m": [1.5, 0, -1.5], "speed_m_s": 0.06}}
    wall = {"name": "wall", "point_ned_m": [0.4, 0, -1.5], "normal_ned": [-1, 0, 0], "width_m": 6, "height_m": 6}
    mission = {
        "name": "crawl",
        "items": [{"takeoff": {"height_m": 1.5}}, crawl, {"land": {}}],
        "sim": {"walls": [wall]},
    }
    mission |= {"on_collision": {"then": "land"}, "fence": {"radius_m": 10, "max_height_m": 6}}
    file, folder = tmp_path / "crawl.yaml", tmp_path / "crawl"
    file.write_text(yaml.safe_dump(mission))
    assert said(capsys, "fly", file, "--lockstep", "--out", folder)[0] == 0
    code, text, _ = said(capsys, "replay", folder, "--expect", "1", "--out", tmp_path / "replay")
    assert code == 0 and "identical" in text
    assert "HIT: struck while hovering, seen by a force that lasts: 2.0 m/s² for 0." in text


def test_a_folder_of_an_earlier_version_is_decided_again(copied):
    # Given one without the versions that flew it, whose mission has the settings of a detector that drones had once
    (copied / "versions.json").unlink()
    resolved = copied / "resolved.yaml"
    mission = yaml.safe_load(resolved.read_text())
    mission["companion"]["lateral"] = {"threshold_m_s2": 4.0}
    resolved.write_text(yaml.safe_dump(mission))
    assert_comes_again(copied)


def test_a_changed_packet_or_an_event_that_does_not_come_again_is_found(copied):
    # Given a flight in whose log one setpoint has another byte
    recording = read_recording(copied)
    step = next(step for step in recording.steps if len(step.sent) == 1 and len(step.sent[0]) > 40)
    step.sent = [step.sent[0][:20] + bytes([step.sent[0][20] ^ 1]) + step.sent[0][21:]]
    assert reproduce(recording)[1] == f"at {step.time_us} us another packet was sent"
    (copied / "events.jsonl").open("a").write('{"time_us": 1, "kind": "x", "text": "", "data": {}}\n')
    assert "did not come again" in reproduce(read_recording(copied))[1]


def test_another_detector_is_looked_at_without_comparing(wall_folder, tmp_path, capsys):
    another = ("--any-mode", "--set", "companion.detector=fused")
    code, text, _ = said(capsys, "replay", wall_folder, *another, "--out", tmp_path)
    assert code == 0
    assert "with --set, --any-mode the flight's own decisions cannot come again" in text
    assert "identical" not in text


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda folder: (folder / "inputs.jsonl").unlink(), "replay"),
        (lambda folder: (folder / "inputs.jsonl").write_text("{\n"), "inputs.jsonl:1"),
        (lambda folder: (folder / "versions.json").write_text("["), "versions.json"),
        (lambda folder: (folder / "versions.json").write_text("5"), "versions.json"),
        (lambda folder: (folder / "events.jsonl").unlink(), "events.jsonl"),
        (lambda folder: (folder / "resolved.yaml").unlink(), "resolved.yaml"),
        (lambda folder: (folder / "flight.tlog").write_bytes(b""), "flight.tlog"),
    ],
)
def test_a_damaged_folder_is_one_sentence(copied, spoil, words, capsys):
    spoil(copied)
    code, text, error = said(capsys, "replay", copied)
    assert code == 1 and text == ""
    assert error.startswith("rebound: ") and words in error and len(error.strip().splitlines()) == 1


def test_a_flight_that_was_not_watched_shows_no_absence_of_collisions(wall_folder, tmp_path, capsys):
    # Given an IMU stream too slow to see a hit by: of 250 samples a second one in 25
    packets, number = [], 0
    for at_us, packet in read_tlog(wall_folder / "flight.tlog"):
        number += message_id_of(packet) == messages.MessageId.HIGHRES_IMU
        if message_id_of(packet) != messages.MessageId.HIGHRES_IMU or number % 25 == 12:
            packets.append(at_us.to_bytes(8, "big") + packet)
    (tmp_path / "slow.tlog").write_bytes(b"".join(packets))
    arguments = (tmp_path / "slow.tlog", "--out", tmp_path, "--expect", "none")
    assert main(["replay", *map(str, arguments)]) == 1
    text = capsys.readouterr().out
    assert "0 % of the flight was watched" in text and "that shows none" in text
    # Unless the person asks for no more
    assert main(["replay", *map(str, arguments), "--least-watched", "0"]) == 0
    # And of a person who expects nothing the log is no evidence either
    assert main(["replay", *map(str, arguments[:3])]) == 1


def test_a_log_that_is_cut_in_flight_is_read_to_its_end_and_says_so(wall_folder, tmp_path, capsys):
    content = (wall_folder / "flight.tlog").read_bytes()
    (tmp_path / "cut.tlog").write_bytes(content[: len(content) // 2])
    for log, is_cut in ((wall_folder / "flight.tlog", False), (tmp_path / "cut.tlog", True)):
        _, text, _ = said(capsys, "replay", log, "--any-mode", "--out", tmp_path / "out")
        assert ("ends in flight" in text) is is_cut
    # And cut before the flight it is no evidence
    (tmp_path / "cut.tlog").write_bytes(content[: len(content) // 10])
    code, text, _ = said(capsys, "replay", tmp_path / "cut.tlog", "--out", tmp_path / "out")
    assert code == 1 and "no flight was heard: that is no evidence" in text


def with_heard(log, *samples):
    """The log with these besides, in the order of their times."""
    return replace(log, heard=tuple(sorted([*log.heard, *samples], key=lambda item: item.at_us)))


def test_a_hit_is_found_with_what_was_known_then():
    (finding,) = watch_log(flight(), LATERAL).impacts
    assert HIT_US < finding.at_us <= HIT_US + 4000
    assert finding.is_collision and finding.threshold_m_s2 == 4.0
    assert finding.first.velocity_ned_m_s[0] == pytest.approx(1.0, abs=0.05)
    assert finding.situation == Situation(None, True, False, 1.5, False, None)
    # And what was known when the contact was over
    assert finding.final.is_final and not finding.first.is_final
    assert finding.final.peak_specific_force_m_s2 == pytest.approx(40.0, abs=1.5)


def test_a_flight_without_a_hit_has_none_and_its_story_is_told():
    findings = watch_log(flight(hit_us=None), LATERAL)
    assert findings.impacts == [] and findings.blind == []
    told = [text for _, text in findings.happenings if "from" not in text]
    assert told == ["mode OFFBOARD", "armed", "took off"]
    assert [off.reason for off in findings.off] == ["disarmed", "on the ground", "below 0.5 m"]
    assert [off.end_us for off in findings.off] == pytest.approx([SECOND, 2 * SECOND, 2.02 * SECOND], abs=5_000)


def test_a_gap_in_the_log_is_a_blind_time():
    findings = watch_log(flight(hit_us=None, gap=(5 * SECOND, 7 * SECOND)), LATERAL)
    (blind,) = findings.blind
    assert "no HIGHRES_IMU" in blind.reason
    assert blind.start_us == pytest.approx(5.25e6, abs=60_000)
    # and is over when the rate has been judged anew, within a second of the samples' return
    assert 7 * SECOND <= blind.end_us <= 8 * SECOND


DOWN = PositionTarget((0.0, 0.0, 0.0), 2.0)


def test_one_old_setpoint_does_not_make_a_crash_a_landing():
    # Given a log that begins with the setpoint of a flight 44 s before, and a vehicle that strikes something 0.5 m up
    log = flight(push_m_s2=60.0)
    low = [
        item._replace(sample=replace(item.sample, position_ned_m=(0.0, 0.0, -0.5)))
        if isinstance(item.sample, LocalPosition) and item.at_us > 2 * SECOND
        else item
        for item in log.heard
    ]
    log = replace(log, heard=(LoggedSample(-44 * SECOND, DOWN), *low))
    findings = watch_log(log, CompanionConfig(detector="fused"))
    assert [finding.is_collision for finding in findings.impacts] == [True]
    # The same with a setpoint that is renewed is one that was asked for
    told = [LoggedSample(time_us, DOWN) for time_us in range(2 * SECOND, 10 * SECOND, SECOND // 5)]
    findings = watch_log(with_heard(log, *told), CompanionConfig(detector="fused"))
    assert [finding.is_collision for finding in findings.impacts] == [False]


def test_a_touchdown_begins_the_next_take_off_and_without_a_position_nothing_is_watched():
    # Given a vehicle that lands by hand on a hill, 3 m above the place of arming
    circumstances, flies = Circumstances(CompanionConfig()), beat(True, 7 << 16)
    for sample in (beat(False), position(0, 0.0), flies, ExtendedState(LandedState.IN_AIR), position(1, 3.0)):
        circumstances.hear((sample,), 0)
    assert circumstances.situation.off_reason is None and circumstances.situation.height_m == pytest.approx(3.0)
    # When it touches the ground
    (finding,) = watch_log(flight(), LATERAL).impacts
    touch = replace(finding.first, impact=replace(finding.first.impact, kind=ImpactKind.LANDING))
    circumstances.note([touch])
    circumstances.hear((position(2, 3.1),), 1)
    # Then heights count from there, and what shakes it until it has climbed again is no hit
    assert circumstances.situation.height_m == pytest.approx(0.1)
    assert circumstances.situation.off_reason == "below 0.5 m"
    circumstances.hear((position(3, 3.7),), 2)
    assert circumstances.situation.off_reason is None
    # And where its last position is a second old, there is none from which a way would lead
    circumstances.hear((flies,), 1_000_002)
    assert circumstances.situation.off_reason == "no position"


@pytest.mark.parametrize(
    ("modes", "failsafe", "reason"),
    [
        (("POSCTL",), 0, "STABILIZED is not among the modes that may be taken over"),
        (("STABILIZED",), 5, "a failsafe flies"),
        (("STABILIZED",), 4, None),
        (None, 5, None),
    ],
)
def test_a_replay_watches_where_the_guard_would(modes, failsafe, reason):
    circumstances = Circumstances(CompanionConfig(), modes)
    flies = replace(beat(True, 7 << 16), system_status=failsafe)
    for sample in (beat(False), position(0, 0.0), flies, ExtendedState(LandedState.IN_AIR), position(1, 3.0)):
        circumstances.hear((sample,), 0)
    assert circumstances.situation.off_reason == reason


def test_of_a_vehicle_that_lies_on_its_back_a_replay_tells_its_crash_and_no_hit():
    # Given a log with a hard hit, whose vehicle lies tipped over since 2 s before, and is disarmed in the end
    log, fell_us = flight(push_m_s2=60.0), HIT_US - 2 * SECOND
    log = replace(log, heard=[one for one in log.heard if one.at_us < fell_us or isinstance(one.sample, ImuSample)])
    heard = [LoggedSample(us, beat(False)) for us in (9 * SECOND, 9 * SECOND + SECOND // 2)]
    for us in range(fell_us, 9 * SECOND, SECOND // 20):
        heard += [LoggedSample(us, Attitude(us, (0.0, 1.0, 0.0, 0.0))), LoggedSample(us, position(us, 0.2))]
    findings = watch_log(with_heard(log, *heard), CompanionConfig())
    # Then that is told, and of the wreck nothing, which is not watched
    assert findings.impacts == [] and "crashed" in [span.reason for span in findings.off]
    (crash,) = [text for _, text in findings.happenings if text.startswith("crashed")]
    assert crash == "crashed: tipped over, tilted by 180 degrees, 0.2 m up, moving at 0.0 m/s"


IDLE, UP = 0.11, 0.13


@pytest.mark.parametrize(
    ("landed", "idle", "pushes", "unknown"),
    [
        (LandedState.IN_AIR, True, True, True),
        (LandedState.ON_GROUND, False, True, False),
        (LandedState.UNDEFINED, False, True, True),
    ],
)
def test_what_flies_or_begins_to_may_crash_and_what_is_carried_may_not(landed, idle, pushes, unknown):
    for thrust, may in ((IDLE, idle), (UP, pushes), (None, unknown)):
        news = [beat(True), ExtendedState(landed), *([] if thrust is None else [messages.AttitudeTarget(1, thrust)])]
        for heard in (news, news[::-1]):
            circumstances = Circumstances(CompanionConfig())
            circumstances.hear([beat(False), position(0, 0.0), *heard], 0)
            assert circumstances.situation.may_crash is may


@pytest.mark.parametrize(
    ("fell_us", "told"), [(100_000, (1, 1)), (LIES_US - 100_000, (1, 0)), (LIES_US + 100_000, (0, 0))]
)
def test_a_vehicle_whose_motors_stop_in_the_air_crashes_though_disarmed_and_landed_by_its_own_word(fell_us, told):
    # Given one that is killed, tips over and meets the ground a while after that
    killed_us, log = HIT_US - fell_us, flight(push_m_s2=60.0)
    killed = [LoggedSample(killed_us, sample) for sample in (beat(False), ExtendedState(LandedState.ON_GROUND))]
    turned = [Attitude(us, (0.0, 1.0, 0.0, 0.0)) for us in range(HIT_US - SECOND // 20, 10 * SECOND, SECOND // 20)]
    killed += [LoggedSample(each.time_boot_us, each) for each in turned]
    findings = watch_log(with_heard(log, *killed), CompanionConfig())
    crashes = [text for _, text in findings.happenings if text.startswith("crashed")]
    assert [finding.is_crash for finding in findings.impacts] == [True] * told[0]
    assert crashes == ["crashed: tipped over, tilted by 180 degrees, 0.0 m up, moving at 1.0 m/s"] * told[1]
    assert findings.flown_us == pytest.approx(killed_us - 2 * SECOND, abs=10_000) and not findings.is_flying


def test_a_margin_is_the_largest_sign_of_a_hit_over_the_threshold():
    # Given a healthy flight with one jolt of 2 m/s^2, where 4 is the threshold and noise of 0.3 times 6 is below it
    log = flight(push_m_s2=2.0)
    (margin,) = margins([log], LATERAL)
    assert (margin.setting, margin.share) == ("threshold_m_s2", pytest.approx(2.0 / 4.0, abs=0.15))
    # Then what needs no change stays as it was; without a jolt it is far from the threshold
    settings, reasons, _ = advise([log], LATERAL, [margin])
    assert settings["lateral"]["threshold_m_s2"] == 4.0
    assert "as it was" in reasons["lateral", "threshold_m_s2"]
    assert [margin.share for margin in margins([flight(hit_us=None)], LATERAL)] == [None]


def test_a_threshold_that_a_healthy_flight_crosses_is_raised_with_a_reserve():
    log = flight(push_m_s2=6.0)
    assert watch_log(log, LATERAL).collisions
    found = margins([log], LATERAL)
    settings, _, left = advise([log], LATERAL, found)
    assert settings["lateral"]["threshold_m_s2"] == pytest.approx(RESERVE * 6.0, rel=0.15)
    assert left == 0


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


def test_the_settings_written_are_what_fly_reads(tmp_path, capsys):
    log, out = healthy_log(tmp_path / "healthy.ulg", 20.0), tmp_path / "mine.yaml"
    code, text, _ = said(capsys, "tune", log, "--out", out)
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
    code, _, error = said(capsys, "tune", log, "--out", out)
    assert code == 1 and "exists already" in error


def test_what_the_file_to_begin_with_says_of_other_things_is_kept(tmp_path, capsys):
    begin, out = tmp_path / "begin.yaml", tmp_path / "mine.yaml"
    begin.write_text("companion: {detector: fused, fused: {side_threshold_m_s2: 8.0}, link: {silence_s: 2.5}}")
    assert said(capsys, "tune", healthy_log(tmp_path / "healthy.ulg", 20.0), "--companion", begin, "--out", out)[0] == 0
    settings = yaml.safe_load(out.read_text())["companion"]
    assert settings["link"] == {"silence_s": 2.5} and settings["fused"]["side_threshold_m_s2"] == 8.0


def test_logs_that_teach_nothing_are_refused(tmp_path, capsys):
    code, text, error = said(capsys, "tune", healthy_log(tmp_path / "short.ulg", 6.0))
    assert code == 1 and text == "" and "too short a flight to learn from, 5 s in the air" in error


def falling(log):
    """From 2 s on it climbs for two seconds at 5 m/s, then it comes down as fast: at 6 s it is at the ground."""

    def moved(item):
        if not isinstance(item.sample, LocalPosition):
            return item
        climbed_s = max(2.0 - abs(4.0 - item.at_us * 1e-6), 0.0)
        sinks_m_s = 0.0 if climbed_s == 0.0 else 5.0 if item.at_us > 4_000_000 else -5.0
        position, velocity = (0.0, 0.0, -5.0 * climbed_s), (0.0, 0.0, sinks_m_s)
        return item._replace(sample=replace(item.sample, position_ned_m=position, velocity_ned_m_s=velocity))

    return replace(log, heard=tuple(map(moved, log.heard)))


def test_a_crash_and_our_own_flight_with_a_hit_are_refused(wall_flight, monkeypatch, capsys):
    monkeypatch.setattr(tuning, "read_log", lambda _: falling(flight(push_m_s2=60.0)))
    code, text, error = said(capsys, "tune", "crashed.ulg")
    assert code == 1 and text == "" and "not a healthy flight, it crashed at 6.0 s" in error
    monkeypatch.undo()
    code, text, error = said(capsys, "tune", wall_flight[0])
    assert code == 1 and text == "" and "not a healthy flight, it had 1 hit;" in error
