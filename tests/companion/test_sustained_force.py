"""Being pushed for long: a vehicle that leans on something is told from one that leans on the wind.

So is one that presses on a ceiling, met too slowly for any sample to show it.
"""

import json
import math

import pytest

from companion.messages import LocalPosition
from companion.mission.model import Mission
from companion.reflex.config import HELD_M_S2, SMOOTHING_S
from companion.reflex.sustained_force import SustainedForceMonitor
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

EVERY_S = 0.02


def leaning_north(acceleration_m_s2):
    """The attitude, nose north, of a vehicle whose thrust carries it and gives that acceleration."""
    half = -0.5 * math.atan(acceleration_m_s2 / 9.80665)
    return (math.cos(half), 0.0, math.sin(half), 0.0)


def watched(seconds, north_m, speed_m_s, tilt_m_s2, goal_north_m=1.0):
    """The first time at which something is found in the way, and what; functions of the time."""
    monitor = SustainedForceMonitor()
    for step in range(round(seconds / EVERY_S)):
        t = step * EVERY_S
        sample = LocalPosition(1_000_000 + round(t * 1e6), (north_m(t), 0.0, -1.5), (speed_m_s(t), 0.0, 0.0))
        monitor.add_imu((0.0, 0.0, -math.hypot(9.80665, tilt_m_s2(t))))
        held = monitor.step(sample, leaning_north(tilt_m_s2(t)), (goal_north_m, 0.0, -1.5))
        if held is not None:
            return t, held
    return None


def test_a_vehicle_that_stands_still_and_leans_more_and_more_is_kept_off_its_goal():
    # Given a lean that the integral of a metre's error makes from the first second on, when nothing moves
    at_s, held = watched(5.0, lambda t: 0.0, lambda t: 0.0, lambda t: 1.0 + 0.8 * max(0.0, t - 1.0))
    # Then it is told as soon as that much has had no effect, with the way out
    assert 0.8 * (at_s - 1.3) == pytest.approx(HELD_M_S2, abs=0.2)
    assert held.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0))


def test_a_lean_that_moves_the_vehicle_is_kept_from_nothing():
    accelerating = watched(3.0, lambda t: 0.5 * t * t, lambda t: t, lambda t: min(1.0, 5.0 * t), goal_north_m=9.0)
    braking = watched(2.0, lambda t: t - 0.5 * t * t, lambda t: 1.0 - t, lambda t: -1.0, goal_north_m=9.0)
    assert accelerating is None and braking is None


def test_what_is_begun_with_in_the_middle_of_speeding_up_is_no_wind():
    """Given a glide that is taken up while the vehicle speeds up away from what it hit, when it brakes past its goal.
    A tail wind gives it 0.7 m/s^2 all the while."""

    def tilt_m_s2(t):
        return 1.5 - 15.0 * min(t, 0.24) - 4.0 * max(0.0, t - 0.24)

    def speed_m_s(t):
        braking_s = max(0.0, t - 0.24)
        begun_s = min(t, 0.24)
        return 0.95 + 2.2 * begun_s - 7.5 * begun_s**2 - 1.4 * braking_s - 2.0 * braking_s**2

    assert watched(0.7, lambda t: 1.0 + 0.55 * t, speed_m_s, tilt_m_s2) is None


def test_a_steady_wind_is_no_wall_however_far_the_vehicle_is_from_its_goal():
    assert watched(5.0, lambda t: 0.0, lambda t: 0.0, lambda t: 3.0) is None


def test_a_gust_that_blows_the_vehicle_away_and_is_leant_against_is_no_wall():
    """Back by 0.4 m with up to 0.4 m/s, as the gust has it; the lean follows late and is what the gust is at last."""

    def speed_m_s(t):
        return -0.4 * math.sin(math.pi * t / 1.6) if t < 1.6 else 0.05

    assert watched(4.0, lambda t: -0.25, speed_m_s, lambda t: min(1.8, 1.2 * t)) is None


def test_a_vehicle_that_comes_nearer_is_not_kept_off():
    assert watched(4.0, lambda t: 0.2 * t, lambda t: 0.2, lambda t: 0.8 * t) is None


def slid(seconds, velocity_m_s, tilt_m_s2):
    """The first time at which something is in the way of a vehicle that leans north; its goal stays ahead of it."""
    monitor, north_m, east_m = SustainedForceMonitor(), 0.0, 0.0
    for step in range(round(seconds / EVERY_S)):
        t = step * EVERY_S
        n, e = velocity_m_s(t)
        north_m, east_m = north_m + n * EVERY_S, east_m + e * EVERY_S
        sample = LocalPosition(1_000_000 + round(t * 1e6), (north_m, east_m, -1.5), (n, e, 0.0))
        monitor.add_imu((0.0, 0.0, -math.hypot(9.80665, tilt_m_s2(t))))
        if monitor.step(sample, leaning_north(tilt_m_s2(t)), (north_m + 0.3, east_m + 0.3, -1.5)) is not None:
            return t
    return None


def test_a_vehicle_that_slides_along_a_wall_and_leans_on_it_more_and_more_is_kept_off():
    """Given a wall to the north, when the vehicle slides east at 0.4 to 0.7 m/s, it is told as where it stands."""
    found_s = slid(5.0, lambda t: (0.05, 0.4 + 0.1 * t), lambda t: 1.2 * max(0.0, t - 1.0))
    assert 1.2 * (found_s - 1.3) == pytest.approx(HELD_M_S2, abs=0.2)


def test_friction_that_brakes_the_slide_does_not_hide_the_wall():
    """Given a wall to the north east, when the vehicle slides along it and friction turns its force by 45 degrees."""
    found_s = slid(5.0, lambda t: (0.25, 0.25), lambda t: 1.2 * max(0.0, t - 1.0))
    assert 1.2 * (found_s - 1.3) == pytest.approx(HELD_M_S2, abs=0.2)


def test_a_gust_across_the_way_of_a_fast_vehicle_is_no_wall():
    """Given 3 m/s east, when a gust of 8 m/s moves it by up to 0.4 m/s before it leans against that with 2.4 m/s^2."""

    def velocity_m_s(t):
        return (-0.4 * math.sin(math.pi * t / 1.6) if t < 1.6 else 0.0), 3.0

    assert slid(6.0, velocity_m_s, lambda t: min(2.4, 1.6 * t)) is None


def test_when_the_way_turns_round_the_lean_on_the_old_side_is_nothing_on_the_new():
    """Given a vehicle found pressing north, when it is sent back south and its lean returns to level."""
    monitor, found = SustainedForceMonitor(), []
    for step in range(200):
        t = step * EVERY_S
        lean = min(0.8 * max(0.0, t - 0.6), 2.4) if not found else max(0.0, 2.4 - 2.0 * (t - found[0]))
        sample = LocalPosition(1_000_000 + round(t * 1e6), (0.0, 0.0, -1.5), (0.0, 0.0, 0.0))
        monitor.add_imu((0.0, 0.0, -math.hypot(9.80665, lean)))
        goal = (-0.35 if found else 1.0, 0.0, -1.5)
        if monitor.step(sample, leaning_north(lean), goal) is not None:
            found.append(t)
    assert len(found) == 1


def flown(folder, items, height_m=1.5, hz=200, **sim):
    """In lockstep: the flight, and what its timeline says of things in the way."""
    data = {
        "name": "slow",
        "companion": {"streams": {"highres_imu_hz": hz}},
        "items": [{"takeoff": {"height_m": height_m}}, *items, {"land": {}}],
        "on_collision": {"then": "hold", "hold_s": 1},
        "fence": {"radius_m": 10, "max_height_m": 6},
        "sim": sim,
    }
    recorder = FlightRecorder(folder)
    world = SimulatedWorld(Scene.model_validate({**sim, "seed": 1}), load_built_in("foldable"))
    mission = Mission.model_validate(with_guards(data, world.airframe))
    flight, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
    recorder.close()
    told = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    return flight, [event for event in told if event["kind"] == "in_the_way"]


def most_tilt_deg(flight):
    _, x, y, _ = flight.truth.series["attitude_wxyz"].T
    return math.degrees(math.acos(min(1.0 - 2.0 * (x * x + y * y))))


def screen(north_m, **motion):
    wall = {"name": "screen", "point_ned_m": [north_m, 0, -1.5], "normal_ned": [-1, 0, 0], "width_m": 6, "height_m": 6}
    return [wall | ({"motion": motion} if motion else {})]


def test_a_wall_met_at_a_crawl_is_backed_away_from(tmp_path):
    # Given a goal 1 m behind a wall, when the vehicle comes with 0.06 m/s, which no detector takes for a hit
    go = {"go_to": {"position_ned_m": [1.5, 0, -1.5], "speed_m_s": 0.06}}
    flight, told = flown(tmp_path, [go], walls=screen(0.5))
    # Then it leans on it for no longer than it takes to be sure, backs away, and the policy follows
    assert len(told) == 1 and len(flight.report.collisions) == 1
    assert most_tilt_deg(flight) < 35.0
    collision = flight.report.collisions[0]
    assert collision.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.2)
    assert collision.recovery_setpoint_ned_m[0] < collision.position_ned_m[0] - 0.25
    assert collision.settled_after_s is not None and collision.settled_after_s < 4.0
    assert flight.report.outcome == "completed"
    assert flight.report.obstacles


@pytest.mark.slow
def test_a_door_that_comes_slowly_pushes_the_hovering_vehicle_out_of_its_way(tmp_path):
    door = screen(0.6, velocity_ned_m_s=[-0.06, 0, 0], from_s=9.0, until_s=20.0)
    flight, told = flown(tmp_path, [{"hold": {"duration_s": 14}}], walls=door)
    assert told and flight.report.outcome == "completed"
    assert most_tilt_deg(flight) < 35.0
    assert all(collision.settled_after_s is not None for collision in flight.report.collisions)


@pytest.mark.slow
def test_gusts_of_five_metres_a_second_are_nothing_in_the_way(tmp_path):
    gusts = [
        {"kind": "gust", "between_s": [9 + 4 * k, 12.5 + 4 * k], "velocity_ned_m_s": [-5 * n, 5 * e, 0], "rise_s": rise}
        for k, (n, e, rise) in enumerate([(1.0, 0.0, 0.3), (0.0, 1.0, 1.0), (-0.7, 0.7, 1.6)])
    ]
    slow = {"go_to": {"position_ned_m": [1, 0, -1.5], "speed_m_s": 0.2}}
    flight, told = flown(tmp_path, [{"hold": {"duration_s": 8}}, slow], wind_ned_m_s=[2, 1, 0], faults=gusts)
    assert told == [] and flight.report.collisions == ()


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(
            {"kind": "motor_failure", "at_s": 10, "motor": 1, "thrust_share": 0.85},
            marks=pytest.mark.slow,
            id="weak motor",
        ),
        pytest.param(
            {"kind": "estimator_reset", "at_s": 10, "position_jump_ned_m": [0.8, 0, 0]}, id="place that jumps"
        ),
    ],
)
def test_what_keeps_a_vehicle_off_its_setpoint_is_not_always_in_the_way(tmp_path, fault):
    slow = {"go_to": {"position_ned_m": [1, 0, -1.5], "speed_m_s": 0.3}}
    flight, told = flown(tmp_path, [{"hold": {"duration_s": 3}}, slow], wind_ned_m_s=[2, 1, 0], faults=[fault])
    assert flight.report.outcome == "completed"
    assert told == [] and flight.report.collisions == ()


@pytest.mark.slow
@pytest.mark.parametrize("speed_m_s", [0.8, 1.3, 1.5])
def test_a_cart_that_comes_after_the_vehicle_it_struck_is_moved_away_from_again(tmp_path, speed_m_s):
    # Given a hovering vehicle, struck by what goes on for two metres more
    cart = screen(1.0, velocity_ned_m_s=[-speed_m_s, 0, 0], from_s=9.5, until_s=12.5)
    flight, _ = flown(tmp_path, [{"hold": {"duration_s": 8}}], walls=cart)
    assert len(flight.truth.hits) > 1, "it touches the vehicle again"
    # Then the vehicle gives way, never leans on it, and takes the end of the long push for no hit from the other side
    assert flight.report.outcome == "completed"
    assert most_tilt_deg(flight) < 35.0
    assert all(collision.normal_ned[0] < -0.5 for collision in flight.report.collisions)
    assert all(collision.settled_after_s is not None for collision in flight.report.collisions[-1:])


HOVER, FULL_M_S2 = 0.5, 19.6133


def watched_below(seconds, fraction, climbed_m=lambda t: 0.0, asked_m=0.2, is_told=True):
    """The first time at which something is found above, and what; functions of the time, 3 s of hovering before it."""
    monitor = SustainedForceMonitor()
    for step in range(-150, round(seconds / EVERY_S)):
        t = step * EVERY_S
        now_us = 10_000_000 + round(t * 1e6)
        climbed, before = (climbed_m(max(each, 0.0)) for each in (t, t - EVERY_S))
        sample = LocalPosition(now_us, (0.0, 0.0, -climbed), (0.0, 0.0, (before - climbed) / EVERY_S))
        if is_told:
            monitor.gain.set_fraction(now_us, fraction(t) if t > 0.0 else HOVER)
        monitor.add_imu((0.0, 0.0, -FULL_M_S2 * HOVER))
        held = monitor.step(sample, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -asked_m if t > 0.0 else 0.0))
        if held is not None:
            return t, held
    return None


def pressing(t):
    """The loops command 1 m/s^2 more each second. The accelerometer goes on showing a hover's."""
    return HOVER + t / FULL_M_S2


def test_more_and_more_thrust_that_nothing_shows_of_presses_on_what_is_above():
    at_s, held = watched_below(5.0, pressing)
    # Then it is told with the low-pass filter's delay
    assert at_s == pytest.approx(HELD_M_S2 + SMOOTHING_S, abs=0.1)
    assert held.normal.direction_ned == (0.0, 0.0, 1.0) and held.peak_specific_force_m_s2 == pytest.approx(
        HELD_M_S2, abs=0.1
    )


@pytest.mark.parametrize(
    ("fraction", "climbed_m", "asked_m"),
    [
        (lambda t: HOVER + 0.1, lambda t: 0.05 * FULL_M_S2 * t * t, 20.0),
        (pressing, lambda t: 0.15 * t, 2.0),
        (lambda t: HOVER + 0.15, lambda t: -0.1 * math.sin(math.pi * min(t, 1.0)), 0.2),
        (pressing, lambda t: 0.15, 0.2),
    ],
    ids=["thrust that is there", "rises, if weakly", "let down by a motor, and back", "is where it is to be"],
)
def test_nothing_is_above_a_vehicle(fraction, climbed_m, asked_m):
    assert watched_below(3.0, fraction, climbed_m, asked_m) is None


def test_without_the_thrust_asked_for_nothing_is_said():
    assert watched_below(5.0, pressing, is_told=False) is None


def test_a_beam_met_at_a_crawl_is_moved_away_from(tmp_path):
    up = {"go_to": {"position_ned_m": [0, 0, -3], "speed_m_s": 0.1}}
    # Given a goal a metre above a beam, when the vehicle comes with 0.1 m/s
    beam = {"name": "beam", "point_ned_m": [0.15, 0, -2], "normal_ned": [0, 0, 1], "width_m": 0.2, "height_m": 6}
    flight, told = flown(tmp_path, [up], height_m=1.3, hz=50, walls=[beam])
    # Then it presses for two seconds and not until the item's time is over, and comes down again
    assert len(told) == 1
    hit = flight.report.collisions[-1]
    assert hit.normal_ned == pytest.approx((0.0, 0.0, 1.0), abs=0.1)
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
    flight, told = flown(tmp_path, [slow, fast], height_m=1.3, hz=50, faults=[fault])
    assert flight.report.outcome == "completed"
    assert told == [] and flight.report.collisions == ()
