"""A log through the watch: what the flight would have known."""

from dataclasses import replace

import pytest

from companion.messages import ExtendedState, LandedState, LocalPosition, PositionTarget
from companion.mission.config import CompanionConfig
from companion.reflex.detector import ImpactKind, Situation
from rebound_cli.logs.log import LoggedSample
from rebound_cli.replay.watching import Circumstances, watch_log
from tests.rebound_cli.replay.flying import HIT_US, LATERAL, SECOND, beat, flight, position


def test_a_hit_is_found_with_what_was_known_then():
    (finding,) = watch_log(flight(), LATERAL).impacts
    assert HIT_US < finding.at_us <= HIT_US + 4000
    assert finding.is_collision and finding.threshold_m_s2 == 4.0
    assert finding.first.velocity_ned_m_s[0] == pytest.approx(1.0, abs=0.05)
    assert finding.situation == Situation(None, True, LandedState.IN_AIR, 1.5, False, None)
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
        replace(item, sample=replace(item.sample, position_ned_m=(0.0, 0.0, -0.5)))
        if isinstance(item.sample, LocalPosition) and item.at_us > 2 * SECOND
        else item
        for item in log.heard
    ]
    log = replace(log, heard=(LoggedSample(-44 * SECOND, DOWN), *low))
    findings = watch_log(log, CompanionConfig(detector="fused"))
    assert [finding.is_collision for finding in findings.impacts] == [True]
    # The same with a setpoint that is renewed is one that was asked for
    told = [LoggedSample(time_us, DOWN) for time_us in range(2 * SECOND, 10 * SECOND, SECOND // 5)]
    log = replace(log, heard=tuple(sorted([*log.heard, *told], key=lambda item: item.at_us)))
    findings = watch_log(log, CompanionConfig(detector="fused"))
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
