"""What the report says of the detector is what the detector did, and listening to it changes nothing."""

import random
from dataclasses import replace

import numpy as np

from companion.messages import Attitude, LocalPosition
from companion.mission.config import CompanionConfig
from rebound_cli.replay.recording import Followed
from rebound_cli.replay.report import replay_log
from rebound_cli.replay.watching import Findings
from rebound_cli.report.content import content
from rebound_cli.report.moments import moments_of
from rebound_cli.report.page import page
from rebound_cli.report.shown_flight import followed_flight, recorded_flight, replayed_flight
from tests.rebound_cli.command import WALL
from tests.rebound_cli.live.flying import fly
from tests.rebound_cli.replay.flying import HIT_US, flight


def test_a_sample_beyond_its_threshold_is_a_hit_and_no_other_is(wall):
    fired = {finding.first.impact.sample_time_boot_us for finding in wall.findings.impacts}
    tested = wall.findings.listener.forces.all()
    beyond = tested.time_boot_us[tested.is_armed & (tested.ratio >= 1.0)]
    # The wall and the touchdown
    assert set(beyond) == fired and len(fired) == 2
    assert wall.findings.listener.shown.keys() == fired


def test_a_simulated_flight_has_its_page_without_being_flown_again(wall, wall_folder, tmp_path):
    # In lockstep
    assert (wall_folder / "report.html").read_text() == page(wall)
    # and by the loop of real flights
    followed = Followed()
    fly(tmp_path, followed=followed, mission_file=WALL)
    shown = replace(followed_flight(tmp_path, followed), versions={})
    assert followed.findings.collisions and page(shown) == page(recorded_flight(tmp_path))


def of_a_log(log):
    config = CompanionConfig()
    return replayed_flight(replay_log(log, config), config)


def test_a_log_of_anybodys_has_a_page_too():
    # Given a push of 40 m/s^2 from ahead at 6 s, in flight at 1 m/s
    shown = of_a_log(flight())
    data = content(shown)
    (moment,) = (moment for moment in data["moments"] if moment["kind"] == "hit")
    assert abs(moment["t"] - HIT_US * 1e-6) < 0.01
    assert data["sentence"].startswith("Hit ") and "of the flight was watched" in data["sentence"]
    assert data["tables"]["imu"]["rows"] > 2000 and data["modes"][0][1] == "OFFBOARD"


def test_a_healthy_flight_is_told_by_its_closest_call():
    shown = of_a_log(flight(hit_us=None))
    (moment,) = moments_of(shown)
    assert moment.kind == "closest" and content(shown)["sentence"].startswith("No hit; ")


def test_a_hit_between_the_samples_is_told_by_the_velocity_that_shows_it():
    # Given a vehicle that a contact between two samples has slowed from 1 to 0.4 m/s
    log, level, chance, heard = flight(hit_us=None), (1.0, 0.0, 0.0, 0.0), random.Random(1), []
    for one in log.heard:
        if isinstance(one.sample, LocalPosition):
            heard.append(replace(one, sample=Attitude(one.at_us, level)))
            velocity = ((1.0 if one.at_us < HIT_US else 0.4) + chance.gauss(0.0, 0.01), 0.0, 0.0)
            one = replace(one, sample=replace(one.sample, velocity_ned_m_s=velocity))
        heard.append(one)
    shown = of_a_log(replace(log, heard=tuple(heard)))
    (moment,) = (moment for moment in moments_of(shown) if moment.kind == "hit")
    (told,) = (reason for reason in moment.reasons if reason.startswith("Velocity jump: 0.6"))
    assert told.endswith("speaks for a contact.") and not any("Push" in reason for reason in moment.reasons)
    # and what it was compared with is the detector's own
    jumps = shown.findings.listener.velocities.all()
    _, limits_m_s = jumps.signs["jump"]
    assert np.count_nonzero(jumps.ratio > 1.0) == 1 and limits_m_s.min() >= 0.12


def test_what_the_simulator_knows_and_nobody_saw_is_told_with_why(wall):
    # Given the same flight by a detector that has told nothing
    (off,) = [span for span in wall.findings.off if span.reason == "connect"]
    blind = Findings(off=[replace(off, end_us=wall.started_at_us + 60_000_000)], listener=wall.findings.listener)
    missed = [moment for moment in moments_of(replace(wall, findings=blind)) if moment.kind == "missed"]
    assert len(missed) == 1 and "a wall at 1.96 m/s" in missed[0].title
    assert missed[0].reasons[0] == "The detector was off: connect."


def test_a_hit_that_nothing_bore_out_is_no_hit_of_the_sentence(wall):
    (hit,) = wall.findings.collisions
    event = {"time_us": hit.at_us + 150_000, "kind": "unconfirmed", "text": "not a hit", "data": {"count": 1}}
    shown = replace(wall, events=[*wall.events, event])
    (moment,) = [moment for moment in moments_of(shown) if moment.kind == "hit"]
    assert "Taken back 150 ms later: nothing else bore it out." in moment.reasons
    assert content(shown)["sentence"].startswith("No hit; ")
