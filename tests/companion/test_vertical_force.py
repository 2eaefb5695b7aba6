"""A ceiling met too slowly for any sample to show it: asked for more and more thrust, the vehicle stands still."""

import json

import pytest

from companion.flight.horizontal_force import HELD_M_S2
from companion.flight.vertical_force import STILL_US, VerticalForceMonitor
from companion.messages import LocalPosition
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

EVERY_S = 0.02
HOVER, FULL_M_S2 = 0.5, 19.6133


def watched(seconds, height_m, fraction, thrust_m_s2, asked_m=lambda t: 2.0):
    """The first time at which something is found above, and what; functions of the time, 3 s of hovering before it."""
    vertical_force = VerticalForceMonitor()
    for step in range(-150, round(seconds / EVERY_S)):
        t = step * EVERY_S
        now_us = 10_000_000 + round(t * 1e6)
        if t < 0.0:
            height, thrust, asked = 1.8, FULL_M_S2 * HOVER, 1.8
            vertical_force.gain.set_fraction(now_us, HOVER)
        else:
            height, thrust, asked = height_m(t), thrust_m_s2(t), asked_m(t)
            vertical_force.gain.set_fraction(now_us, fraction(t))
        held = vertical_force.step(LocalPosition(now_us, (0.0, 0.0, -height), (0.0, 0.0, 0.0)), thrust, -asked)
        if held is not None:
            return t, held
    return None


def test_more_and_more_thrust_that_nothing_shows_of_presses_on_what_is_above():
    # When the loops ask for 1 m/s^2 more each second, and the accelerometer goes on showing a hover's
    at_s, held = watched(5.0, lambda t: 1.8, lambda t: HOVER + t / FULL_M_S2, lambda t: FULL_M_S2 * HOVER)
    # Then it is told half a second late, the means' delay, and no sooner than it is known to stand still
    assert at_s == pytest.approx(HELD_M_S2 + 0.5, abs=0.2)
    assert held.normal_ned == (0.0, 0.0, 1.0) and held.force_m_s2 == pytest.approx(HELD_M_S2, abs=0.1)
    assert at_s > STILL_US * 1e-6


@pytest.mark.parametrize(
    ("height_m", "fraction", "thrust_m_s2"),
    [
        (lambda t: 1.8, lambda t: HOVER + 0.1, lambda t: FULL_M_S2 * (HOVER + 0.1)),
        (lambda t: 1.8 + 0.06 * t, lambda t: HOVER + 0.2, lambda t: FULL_M_S2 * HOVER),
        (lambda t: 1.8 - 0.1 * min(t, 1.0) + 0.1 * max(t - 1.0, 0.0), lambda t: HOVER + 0.2, lambda t: 9.8),
        (lambda t: 2.0, lambda t: HOVER + 0.2, lambda t: FULL_M_S2 * HOVER),
    ],
    ids=["thrust that is there", "rises, if weakly", "let down by a motor, and back", "is where it is to be"],
)
def test_nothing_is_above_a_vehicle(height_m, fraction, thrust_m_s2):
    assert watched(3.0, height_m, fraction, thrust_m_s2) is None


def test_without_the_thrust_asked_for_nothing_is_said():
    vertical_force = VerticalForceMonitor()
    for step in range(400):
        sample = LocalPosition(step * 20_000, (0.0, 0.0, -1.8), (0.0, 0.0, 0.0))
        assert vertical_force.step(sample, 9.8, -2.5) is None


def flown(folder, items, airframe="foldable", **sim):
    """In lockstep, at PX4's default 50 Hz: the flight, and what its timeline says of things in the way."""
    data = {
        "name": "slow",
        "companion": {"streams": {"highres_imu_hz": 50}},
        "items": [{"takeoff": {"height_m": 1.3}}, *items, {"land": {}}],
        "on_collision": {"then": "hold", "hold_s": 1},
        "fence": {"radius_m": 10, "max_height_m": 6},
        "sim": sim,
    }
    recorder = FlightRecorder(folder)
    world = SimulatedWorld(Scene.model_validate({**sim, "seed": 1}), load_built_in(airframe))
    mission = Mission.model_validate(with_guards(data, world.airframe))
    flight, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
    recorder.close()
    told = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    return flight, [event for event in told if event["kind"] == "in_the_way"]


def test_a_beam_met_at_a_crawl_is_moved_away_from(tmp_path):
    # Given a goal a metre above a beam, when the vehicle comes with 0.1 m/s
    beam = {"name": "beam", "point_ned_m": [0.15, 0, -2], "normal_ned": [0, 0, 1], "width_m": 0.2, "height_m": 6}
    flight, told = flown(tmp_path, [{"go_to": {"position_ned_m": [0, 0, -3], "speed_m_s": 0.1}}], walls=[beam])
    # Then it presses for two seconds and not until the item's time is over, and comes down again
    assert len(told) == 1
    hit = flight.report.collisions[-1]
    assert hit.normal_ned == pytest.approx((0.0, 0.0, 1.0), abs=0.05)
    assert hit.recovery_setpoint_ned_m[2] > hit.position_ned_m[2] + 0.25
    assert hit.settled_after_s is not None
    assert flight.report.outcome == "completed"


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(
            {"kind": "gust", "between_s": [10, 20], "velocity_ned_m_s": [0, 0, 5]},
            marks=pytest.mark.slow,
            id="wind from above",
        ),
        pytest.param(
            {"kind": "battery_sag", "between_s": [10, 12], "voltage_share": 0.95},
            marks=pytest.mark.slow,
            id="weak battery",
        ),
        pytest.param({"kind": "motor_failure", "at_s": 10, "motor": 1, "thrust_share": 0.85}, id="weak motor"),
    ],
)
def test_what_keeps_a_vehicle_down_is_not_always_above_it(tmp_path, fault):
    slow = {"go_to": {"position_ned_m": [0, 0, -2], "speed_m_s": 0.2}}
    fast = {"go_to": {"position_ned_m": [0, 0, -4], "speed_m_s": 1.0}}
    flight, told = flown(tmp_path, [slow, fast], faults=[fault])
    assert flight.report.outcome == "completed"
    assert told == [] and flight.report.collisions == ()
