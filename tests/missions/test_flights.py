"""The missions that ship, flown in lockstep: each does what its file says."""

import numpy as np
import pytest

from rebound_cli.interrupts import Interrupts
from rebound_cli.lockstep import fly_mission_lockstep
from rebound_cli.run_folder import FlightRecorder
from rebound_cli.truth_match import match_contacts
from tests.missions.test_missions import CONTACT_REACH_M, load


@pytest.fixture(scope="module")
def fly(tmp_path_factory):
    """Flies a mission once and remembers the flight."""
    flown = {}

    def flight_of(name):
        if name not in flown:
            mission, world = load(name)
            recorder = FlightRecorder(tmp_path_factory.mktemp(name))
            flown[name], _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
            recorder.close()
        return flown[name]

    return flight_of


@pytest.mark.parametrize("name", ["corner", "oblique", "paper", "wall"])
def test_each_wall_is_hit_seen_and_left_behind(fly, name):
    flown = fly(name)
    assert flown.report.outcome == "completed", flown.report.reason
    matches = match_contacts(flown.report.collisions, flown.truth.hits, 0.5)
    assert (matches.false_detections, matches.missed_contacts) == (0, 0)
    assert len(flown.report.collisions) >= 1
    # the recovery setpoint leads away from the wall that was hit
    collision, hit = flown.report.collisions[0], flown.truth.hits[0]
    away = np.subtract(collision.recovery_setpoint_ned_m, hit.contact_position_ned_m)
    assert away @ np.array(hit.normal_ned) > 0.3


def test_the_square_hits_nothing_and_detects_nothing(fly):
    flown = fly("square")
    assert flown.report.outcome == "completed", flown.report.reason
    assert flown.report.collisions == () and flown.truth.hits == []
    # all four corners were passed within the acceptance radius of 0.2 m and the landing is at the start
    path = flown.truth.series["position_ned_m"]
    for north_m, east_m in ((4, 0), (4, 4), (0, 4), (0, 0)):
        distance_m = np.hypot(path[:, 0] - north_m, path[:, 1] - east_m)
        assert distance_m.min() < 0.25
    assert np.hypot(*path[-1, :2]) < 0.4


def test_the_wall_missions_come_home(fly):
    for name in ("wall", "corner", "oblique"):
        assert np.hypot(*fly(name).truth.series["position_ned_m"][-1, :2]) < 0.5


def test_the_corner_is_left_on_both_axes(fly):
    flown = fly("corner")
    collision, hit = flown.report.collisions[0], flown.truth.hits[0]
    back_m = np.subtract(hit.contact_position_ned_m, collision.recovery_setpoint_ned_m)[:2]
    # 2 m/s along the diagonal and gamma = 0.5: 0.7 m on each axis
    assert back_m == pytest.approx([0.71, 0.71], abs=0.12)


def test_the_papers_scenario_is_met(fly):
    # Given the flight of the paper's sample scenario
    flown = fly("paper")
    hit = flown.truth.hits[0]
    series = flown.truth.series
    guard_north_m = series["position_ned_m"][:, 0] + CONTACT_REACH_M
    before = series["time_boot_us"] < hit.contact_at_boot_us
    crossing = np.flatnonzero(before & (guard_north_m < 0.0))[-1]
    # When the guards cross x = 0 and then touch the wall
    crossing_speed_m_s = series["velocity_ned_m_s"][crossing, 0]
    until_contact_s = (hit.contact_at_boot_us - series["time_boot_us"][crossing]) / 1e6
    # Then it is at about 1.5 m/s, and about 0.2 s later at about 1.4 m/s, 4 m up
    assert crossing_speed_m_s == pytest.approx(1.5, abs=0.08)
    assert until_contact_s == pytest.approx(0.2, abs=0.02)
    assert hit.impact_velocity_ned_m_s[0] == pytest.approx(1.4, abs=0.08)
    assert hit.contact_position_ned_m[2] == pytest.approx(-4.0, abs=0.2)
