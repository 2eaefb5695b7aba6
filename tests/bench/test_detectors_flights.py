"""The bench's healthy flights and recorded impacts: what is flown, and PX4's way of averaging and clipping."""

import math

import numpy as np
import pytest

from bench.cases.mishaps import FlightCase
from bench.fly import cruise
from bench.fly.cruise import fly_healthy
from bench.fly.recorded import DataError, averaged, data_files, turned, with_impact
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry
from rebound_cli.logs.log import Log, LoggedSample
from sim_vehicle.airframe import load_built_in

REST = np.array([0.0, 0.0, -9.81])


# --- healthy flights --------------------------------------------------------------------------------------------------


def test_a_healthy_flight_goes_from_the_ground_to_the_ground_and_is_hard(monkeypatch):
    # Given a pilot with half a minute in the air
    monkeypatch.setattr(cruise, "AIRBORNE_S", 30.0)
    flown = fly_healthy(FlightCase("calm", 0, "foldable", ()), load_built_in("foldable"))
    samples, situations = flown.recording.samples, flown.recording.situations
    phases = np.array(flown.phases)
    # Then it begins and ends on the ground, motors off at the end, after a landing that was felt
    assert (phases[0], phases[-1]) == ("ground", "landed")
    assert situations[-1].landed_state is LandedState.ON_GROUND and situations[-1].armed is False
    assert abs(samples[-1].position_ned_m[2] - samples[0].position_ned_m[2]) < 0.1
    felt = [math.hypot(*s.specific_force_frd_m_s2) for s, p in zip(samples, phases, strict=True) if p == "landing"]
    assert max(felt) > 18.0
    # And only in take-off and on the ground nothing is to be reported
    off = {phase for phase, now in zip(phases, situations, strict=True) if now.off_reason is not None}
    assert off == {"ground", "takeoff"}
    # And no obstacle was ever touched
    assert not any(flown.recording.contact_m_s2)


def test_a_flip_goes_all_the_way_round_and_is_caught(monkeypatch):
    # Given a pilot who knows nothing but flips
    for manoeuvre in ("_dash", "_jump", "_stop", "_slalom", "_spin", "_hover"):
        monkeypatch.setattr(cruise.Pilot, manoeuvre, cruise.Pilot._flip)
    monkeypatch.setattr(cruise, "AIRBORNE_S", 4.0)
    flown = fly_healthy(FlightCase("calm", 3, "rigid", ()), load_built_in("rigid"))
    # Then the vehicle was upside down on the way, and upright soon after
    upright = [1 - 2 * (s.attitude_wxyz[1] ** 2 + s.attitude_wxyz[2] ** 2) for s in flown.recording.samples]
    phases = flown.phases
    flipped = [u for u, phase in zip(upright, phases, strict=True) if phase == "flip"]
    assert min(flipped) < -0.95
    assert upright[len(phases) - 1 - phases[::-1].index("caught")] > 0.95


# --- recorded impacts -------------------------------------------------------------------------------------------------


def test_each_sample_is_clipped_before_the_mean():
    # Given a force of 100 g for one of five milliseconds
    force = np.array([[1000.0, 0.0, 0.0]])
    # Then the mean over the 5 ms shows 16 g for a fifth of it, if the impact is in the window at all
    assert averaged(REST, force, 0.003, 0.005) == pytest.approx([156.9 / 5, 0.0, -9.81])
    assert averaged(REST, force, 0.010, 0.005) == pytest.approx(REST)
    assert averaged(REST, force, 0.000, 0.005) == pytest.approx(REST)


def test_what_is_not_clipped_keeps_its_impulse():
    force = np.full((20, 3), (30.0, -20.0, 5.0))
    windows = [averaged(REST, force, 0.001 + 0.005 * k, 0.005) - REST for k in range(6)]
    assert np.sum(windows, axis=0) * 0.005 == pytest.approx([0.6, -0.4, 0.1])


def test_an_impact_is_turned_to_where_it_is_to_come_from():
    rng = np.random.default_rng(1)
    force = rng.normal((0.0, 0.0, 5.0), 1.0, (30, 3))
    result = turned(force, (0.6, 0.8, 0.0), 2.0)
    impulse = result.sum(axis=0)
    assert impulse / np.linalg.norm(impulse) == pytest.approx([0.6, 0.8, 0.0])
    assert np.linalg.norm(result, axis=1) == pytest.approx(np.linalg.norm(force, axis=1))


def test_a_flight_with_an_impact_in_it_differs_from_then_on_only(tmp_path):
    # Given a hovering flight, nose to the east
    heard = []
    for number in range(400):
        at_us = 5_000 * number
        heard.append(LoggedSample(at_us, ImuSample(at_us, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0))))
        if number % 20 == 0:
            heard.append(LoggedSample(at_us, LocalPosition(at_us, (0.0, 0.0, -5.0), (0.0, 0.0, 0.0))))
            heard.append(LoggedSample(at_us, Odometry(at_us, (0.0, 0.0, -5.0), (0.0, 0.0, 0.0), 0)))
            heard.append(LoggedSample(at_us, Attitude(at_us, (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))))
    log = Log(tmp_path, "", 0, tuple(heard), ())
    # When something pushes it from the front for 10 ms
    struck = with_impact(log, np.full((10, 3), (-100.0, 0.0, 0.0)), 500_000, 1_000_000)
    # Then nothing is different before
    for item in struck.heard:
        if item.at_us < 1_000_000:
            assert item in heard
    # And its inertial samples begin where the slice does, everything else at the log's beginning
    assert min(item.at_us for item in struck.heard if isinstance(item.sample, ImuSample)) == 500_000
    assert struck.heard[0].at_us == 0
    # And afterwards it moves west at the impulse's speed, as an estimator that believes its sensor has it
    for told in (LocalPosition, Odometry):
        last = [item.sample for item in struck.heard if isinstance(item.sample, told)][-1]
        assert last.velocity_ned_m_s == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)
        assert last.position_ned_m[1] < -0.3


def test_a_folder_without_the_data_is_one_sentence(tmp_path):
    with pytest.raises(DataError, match="point --data at the folder"):
        data_files(tmp_path)
