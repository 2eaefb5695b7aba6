"""Being pushed for long: a vehicle that leans on something is told from one that leans on the wind.

So is one that presses on a ceiling, met too slowly for any sample to show it.
"""

import math

import pytest

from companion.messages import Attitude, AttitudeTarget, ImuSample, LocalPosition
from companion.motion.strapdown import Strapdown
from companion.reflex.config import HELD_M_S2
from companion.reflex.detection.sustained_force import SustainedForceMonitor
from sim_vehicle.airframe import load_built_in
from tests.simulated import SimulatedFlight, flown, simulated, wall

EVERY_S = 0.02


def leaning(m_s2):
    """Nose north, of a vehicle whose thrust carries it and gives that acceleration, north + east j."""
    half, way = 0.5 * math.atan(abs(m_s2) / 9.80665), m_s2 / max(abs(m_s2), 1e-9)
    return (math.cos(half), way.imag * math.sin(half), -way.real * math.sin(half), 0.0)


def watched(
    seconds, velocity_m_s, tilt_m_s2, goal_ahead_m=(1.0, 0.0), goes=True, asked_m_s2=None, unbroken_s=9.0, stalls_s=9.0
):
    """The first time at which something is found in the way of a vehicle that leans north, and what.

    Its velocity and lean are functions of the time, and so is what its own control asks for. The goal goes with it,
    unless it stands where it was. From `unbroken_s` on the estimate is reset again and again. What comes from
    `stalls_s` on is looked at once all has come.
    """
    monitor, strapdown, north_m, east_m = SustainedForceMonitor(), Strapdown(), 0.0, 0.0
    waiting = []
    for step in range(round(seconds / EVERY_S)):
        t = step * EVERY_S
        n, e = velocity_m_s(t)
        north_m, east_m = north_m + n * EVERY_S, east_m + e * EVERY_S
        sample = LocalPosition(1_000_000 + round(t * 1e6), (north_m, east_m, -1.5), (n, e, 0.0))
        monitor.add_imu((0.0, 0.0, -math.hypot(9.80665, tilt_m_s2(t))))
        ahead_n, ahead_e = goal_ahead_m
        goal = (north_m + ahead_n, east_m + ahead_e, -1.5) if goes else (ahead_n, ahead_e, -1.5)
        strapdown.imu(sample.time_boot_us, monitor.measured_frd_m_s2, (0.0, 0.0, 0.0))
        strapdown.attitude(sample.time_boot_us, leaning(tilt_m_s2(t)))
        if t < unbroken_s:
            strapdown.velocity(sample)
        else:
            strapdown.fixes.clear()
        waiting.append((t, sample, goal))
        if stalls_s <= t < seconds - EVERY_S:
            continue
        for at_s, sample, goal in waiting:
            if asked_m_s2 is not None:
                monitor.set_attitude(AttitudeTarget(sample.time_boot_us, 0.0, leaning(asked_m_s2(at_s))))
            held = monitor.step(sample, strapdown, goal, True, True)
            if held is not None:
                return at_s, held
        waiting.clear()
    return None


def still(t):
    return 0.0, 0.0


@pytest.mark.parametrize(
    ("velocity_m_s", "goal_ahead_m"),
    [(still, (1.0, 0.0)), (lambda t: (0.05, 0.4 + 0.1 * t), (0.3, 0.3)), (lambda t: (0.25, 0.25), (0.3, 0.3))],
    ids=["stands", "slides along", "slides while friction turns the force by 45 degrees"],
)
def test_a_vehicle_that_leans_on_a_wall_more_and_more_is_kept_off(velocity_m_s, goal_ahead_m):
    # Given a lean that grows from the first second on
    at_s, held = watched(5.0, velocity_m_s, lambda t: 1.2 * max(0.0, t - 1.0), goal_ahead_m)
    # Then it is told as soon as that much has had no effect, with the way out
    assert 1.2 * (at_s - 1.3) == pytest.approx(HELD_M_S2, abs=0.2)
    assert held.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.03)


def gust(t):
    """Back by 0.4 m with up to 0.4 m/s."""
    return -0.4 * math.sin(math.pi * t / 1.6) if t < 1.6 else 0.0


def glide(t):
    braking_s, begun_s = max(0.0, t - 0.24), min(t, 0.24)
    return 0.95 + 2.2 * begun_s - 7.5 * begun_s**2 - 1.4 * braking_s - 2.0 * braking_s**2, 0.0


AT = (0.03, 0.03)  # the setpoint


def slides(t):
    return 0.05, 0.6


def asked(t):
    return 2.5 if t < 1.6 else 1.0


def tips(t):
    return asked(t) + 4.0 * max(0.0, t - 2.0)


def test_a_vehicle_that_tips_further_than_its_control_asks_for_is_kept_off():
    # Given a vehicle at its setpoint that slides along a wall, and tips towards it although 6 degrees are asked for
    at_s, held = watched(4.0, slides, tips, AT, asked_m_s2=asked)
    # Then it is told at 10 degrees, long before the force has lasted
    assert tips(at_s) == pytest.approx(1.75, abs=0.15)
    assert held.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.03)
    # And not where the attitude has been silent, or the estimate was reset
    assert watched(2.3, slides, tips, AT, asked_m_s2=asked, unbroken_s=2.1) is None


def test_setpoints_of_before_a_stall_are_not_compared_with_the_attitude_after_it():
    def leans(t):
        return 1.0 if t < 2.5 else 4.0

    assert watched(3.1, slides, lambda t: leans(t - 0.15), AT, asked_m_s2=leans, stalls_s=1.9) is None


@pytest.mark.parametrize(
    ("seconds", "velocity_m_s", "tilt_m_s2", "goal_m", "asked_m_s2"),
    [
        (3.0, lambda t: (t, 0.0), lambda t: min(1.0, 5.0 * t), (9.0, 0.0), None),
        (2.0, lambda t: (1.0 - t, 0.0), lambda t: -1.0, (9.0, 0.0), None),
        # Taken up while the vehicle speeds up away from what it hit, with a tail wind that gives it 0.7 m/s^2
        (0.7, glide, lambda t: 1.5 - 15.0 * min(t, 0.24) - 4.0 * max(0.0, t - 0.24), (0.0, 0.0), None),
        (5.0, still, lambda t: 3.0, (1.0, 0.0), None),
        # The lean follows late and is what the gust is at last
        (4.0, lambda t: (gust(t), 0.0), lambda t: min(1.8, 1.2 * t), (1.0, 0.0), None),
        (6.0, lambda t: (gust(t), 3.0), lambda t: min(2.4, 1.6 * t), (0.3, 0.3), None),
        (4.0, lambda t: (0.2, 0.0), lambda t: 0.8 * t, (1.0, 0.0), None),
        (2.3, slides, lambda t: 6.0 - 14.0 * max(0.0, t - 2.0), AT, lambda t: 6.0 - 14.0 * max(0.0, t - 1.75)),
        (2.1, slides, lambda t: 11.5 - 5.0 * max(1.8, t), AT, lambda t: 2.5 if t < 1.8 else 4j if t < 1.9 else -4j),
        (2.3, lambda t: (tips(t) * max(0.0, t - 2.0), 0.6), tips, AT, asked),
        (2.3, lambda t: (3.0, 0.6), tips, AT, asked),
        (2.3, slides, lambda t: 2.0 * asked(t) - tips(t), AT, asked),
        (2.3, slides, lambda t: tips(t) + 0.3 * math.sin(9.0 * t), AT, asked),
    ],
    ids=[
        *("speeds up", "brakes", "glides past its goal", "wind", "gust", "gust across the way", "comes nearer"),
        *("lags", "amid three", "speeds up as it tips", "fast", "rights itself", "never follows well"),
    ],
)
def test_a_lean_that_something_else_explains_is_no_wall(seconds, velocity_m_s, tilt_m_s2, goal_m, asked_m_s2):
    assert watched(seconds, velocity_m_s, tilt_m_s2, goal_m, goal_m[1] > 0.0, asked_m_s2) is None


# --- in flight


def in_room(*items, height_m=1.5, hz=200, **sim) -> SimulatedFlight:
    fence, then = {"radius_m": 10, "max_height_m": 6}, {"then": "hold", "hold_s": 1}
    streams = {"streams": {"highres_imu_hz": hz}}
    flight = flown(*items, height_m=height_m, companion=streams, on_collision=then, fence=fence, sim=sim)
    assert flight.report.outcome == "completed"
    return flight


def test_a_wall_met_at_a_crawl_is_backed_away_from():
    # Given a goal 1 m behind a wall, when the vehicle comes with 0.06 m/s, which no detector takes for a hit
    flight = in_room({"go_to": {"position_ned_m": [1.5, 0, -1.5], "speed_m_s": 0.06}}, walls=[wall(0.5)])
    # Then it leans on it for no longer than it takes to be sure, backs away, and the policy follows
    (collision,) = flight.report.collisions
    assert flight.kinds().count("in_the_way") == 1 and flight.tilt_deg.max() < 45.0
    assert collision.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.2)
    assert collision.recovery_setpoint_ned_m[0] < collision.position_ned_m[0] - 0.25
    assert collision.settled_after_s is not None and collision.settled_after_s < 4.0
    assert flight.report.obstacles


def test_a_beam_met_at_a_crawl_is_moved_away_from():
    # Given a goal a metre above a beam, when the vehicle comes with 0.1 m/s
    beam = {"name": "beam", "point_ned_m": [0.15, 0, -2], "normal_ned": [0, 0, 1], "width_m": 0.2, "height_m": 6}
    up = {"go_to": {"position_ned_m": [0, 0, -3], "speed_m_s": 0.1}}
    flight = in_room(up, height_m=1.3, hz=50, walls=[beam])
    # Then it presses for two seconds and not until the item's time is over, and comes down again
    assert flight.kinds().count("in_the_way") == 1
    hit = flight.report.collisions[-1]
    assert hit.normal_ned == pytest.approx((0.0, 0.0, 1.0), abs=0.1) and hit.settled_after_s is not None
    assert hit.recovery_setpoint_ned_m[2] > hit.position_ned_m[2] + 0.25


@pytest.mark.slow
@pytest.mark.parametrize("speed_m_s", [0.06, 0.8, 1.2, 1.3, 1.4, 1.6])
def test_a_door_that_comes_after_the_hovering_vehicle_is_moved_away_from(speed_m_s):
    # Given a hovering vehicle, and a door that pushes it, or strikes it and goes on for two metres more
    comes = {"velocity_ned_m_s": [-speed_m_s, 0, 0], "from_s": 9.5, "until_s": 20.5 if speed_m_s < 0.1 else 12.5}
    flight = in_room({"hold": {"duration_s": 14}}, walls=[wall(0.6 if speed_m_s < 0.1 else 1.0, motion=comes)])
    # Then the vehicle gives way, never leans on it, and takes the end of the long push for no hit from the other side
    assert flight.report.collisions and flight.tilt_deg.max() < 45.0
    assert all(collision.normal_ned[0] < -0.5 for collision in flight.report.collisions)
    assert flight.report.collisions[-1].settled_after_s is not None


GUSTS = [
    {"kind": "gust", "between_s": [9 + 4 * k, 12.5 + 4 * k], "velocity_ned_m_s": [-5 * n, 5 * e, 0], "rise_s": rise}
    for k, (n, e, rise) in enumerate([(1.0, 0.0, 0.3), (0.0, 1.0, 1.0), (-0.7, 0.7, 1.6)])
]


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(GUSTS, marks=pytest.mark.slow, id="gusts"),
        pytest.param(
            [{"kind": "gust", "between_s": [10, 20], "velocity_ned_m_s": [0, 0, 5]}],
            marks=pytest.mark.slow,
            id="wind from above",
        ),
        pytest.param(
            [{"kind": "battery_sag", "between_s": [10, 12], "voltage_share": 0.95}],
            marks=pytest.mark.slow,
            id="weak battery",
        ),
        pytest.param([{"kind": "motor_failure", "at_s": 10, "motor": 1, "thrust_share": 0.85}], id="weak motor"),
        pytest.param(
            [{"kind": "estimator_reset", "at_s": 10, "position_jump_ned_m": [0.8, 0, 0]}], id="place that jumps"
        ),
    ],
)
def test_what_keeps_a_vehicle_off_its_setpoint_is_not_always_in_the_way(fault):
    slow = {"go_to": {"position_ned_m": [1, 0, -2], "speed_m_s": 0.2}}
    fast = {"go_to": {"position_ned_m": [1, 0, -4], "speed_m_s": 1.0}}
    flight = in_room({"hold": {"duration_s": 3}}, slow, fast, height_m=1.3, wind_ned_m_s=[2, 1, 0], faults=fault)
    assert flight.told("in_the_way") == [] and flight.report.collisions == ()


@pytest.mark.parametrize("law", ["adaptive", "paper"])
def test_a_vehicle_that_a_hit_has_turned_is_not_tipped_by_something_else(law: str):
    # Given a fast oblique hit that turns a vehicle
    go_to, oblique = {"position_ned_m": [12, 0, -1.5], "speed_m_s": 3.5}, wall(6.0, normal_ned=[-0.9, 0.4, 0])
    flight = flown({"go_to": go_to}, recovery={"law": law}, on_collision={"then": "land"}, sim={"walls": [oblique]})
    # Then that is one hit
    assert flight.told("in_the_way") == [] and len(flight.report.collisions) == 1


def test_a_vehicle_that_rests_after_a_hit_is_kept_off_what_tips_it_then():
    # Given a recovery whose vehicle has come to rest
    go_to = {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}
    flight = simulated([{"takeoff": {"height_m": 1.5}}, {"go_to": go_to}, {"land": {}}], sim={"walls": [wall(3.0)]})
    flight.run_to("recovering")
    flight.run_for(1.5)
    core, reflex = flight.companion.core, flight.companion.core.reflex
    assert flight.state == "recovering" and reflex.newest.has_rested
    situation, begins_us = core.situation(), reflex.sample_boot_us
    place, found = reflex.monitor.estimator.history.latest.position_ned_m, []
    # When it is to hover, and turns nose down with 1 rad/s from 0.4 s on
    for step in range(1, 45):
        after_us, turned_rad = round(1e6 * EVERY_S * step), max(0.0, EVERY_S * step - 0.4)
        at_us, rates = begins_us + after_us, (0.0, -1.0 if turned_rad > 0.0 else 0.0, 0.0)
        attitude = (math.cos(0.5 * turned_rad), 0.0, -math.sin(0.5 * turned_rad), 0.0)
        samples = [
            AttitudeTarget(at_us, 0.5, leaning(0.0)),
            # A sensor that repeats itself would be stuck
            ImuSample(at_us, (0.0, 0.001 * step, -9.81), rates),
            Attitude(at_us, attitude, rates),
            LocalPosition(at_us, place, (0.0, 0.0, 0.0)),
        ]
        found = reflex.step(samples, situation, flight.now_us + after_us).collisions
        if found:
            break
    # Then something is in its way at less than 20 degrees, north of it
    assert found and turned_rad < math.radians(20.0)
    assert found[0].normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.1)


def test_a_recovery_begins_with_the_wind_of_the_hover_before_it():
    # Given a hover in a wind, and a fast way into a wall
    fast = {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 3.0}}
    sim = {"wind_ned_m_s": [0, 4, 0], "walls": [wall(3.0)]}
    flight = simulated([{"takeoff": {"height_m": 1.5}}, {"hold": {"duration_s": 2}}, fast, {"land": {}}], sim=sim)
    flight.run_to("recovering")
    # Then the first attitude off the wall stands against that wind, and not against what speed made of it
    airframe, reflex = load_built_in("foldable"), flight.companion.core.reflex
    known, wind_m_s2 = reflex.newest.estimator.wind_m_s2, 4.0 * airframe.drag_n_s_m / airframe.mass_kg
    assert known == pytest.approx((0.0, wind_m_s2, 0.0), abs=0.1)
    # And what it feels at rest in the recovery, a wall perhaps, is no wind of the next hit
    flight.run_for(1.4)
    assert flight.state == "recovering" and reflex.sustained_force.hover_wind_m_s2 == known


def test_an_attitude_setpoint_that_is_stamped_ahead_is_forgotten_with_the_next_one():
    monitor = SustainedForceMonitor()
    for time_us in (1_000_000, 9_000_000, 1_100_000, 1_080_000):
        monitor.set_attitude(AttitudeTarget(time_us, 0.5, (1.0, 0.0, 0.0, 0.0)))
    assert [time_us for time_us, _ in monitor.setpoints] == [1_100_000]
