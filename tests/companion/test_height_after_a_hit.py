"""Height after a hit: how it throws a vehicle up or down, what the estimate lacks of it, and how that is ended."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from companion.estimate.rotation import ned_to_body, turned
from companion.estimate.strapdown import Strapdown
from companion.messages import Attitude, LocalPosition
from companion.mission.config import GuardsConfig
from companion.recovery.climb import FALLING_MOST_M_S2, Climb
from companion.recovery.height import NO_BRAKING, brake, level
from companion.recovery.thrown import STIFF_RESTITUTION, Approach, thrown
from companion.recovery.unseen import Unseen, missing
from companion.recovery.way import Motion

GUARDS = GuardsConfig()
SOUTH, ZERO = (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
# Quad-x, one guard ahead.
ARM_AHEAD = turned(LEVEL, (0.0, 0.0, 1.0), math.radians(45.0))


@pytest.mark.parametrize("speed_m_s", [-0.6, -0.3, 0.4])
def test_braking_ends_when_the_vehicle_has_stopped(speed_m_s):
    """Given the vehicle's own loop, w' = -4 w, and a motor's and the estimate's 0.04 s before it acts."""
    braking = brake(speed_m_s, 3.0, 0)
    assert math.copysign(1.0, braking.acceleration_down_m_s2) == -math.copysign(1.0, speed_m_s)
    w, way = speed_m_s, 0.0
    for step in range(200):
        late = step * 0.002 >= 0.04
        w += 0.002 * (-4.0 * w + (braking.at(round(1e6 * (step * 0.002 - 0.04))) if late else 0.0))
        way += 0.002 * w
    assert abs(w) < 0.1, "neither on nor back"
    assert abs(way) < abs(speed_m_s) / 4.0, "less than without"


def test_nothing_is_braked_that_is_slow_or_unwanted():
    assert brake(0.05, 3.0, 0) == NO_BRAKING
    assert brake(1.0, 0.0, 0) == NO_BRAKING


def nose_down(degrees: float) -> tuple[float, float, float, float]:
    """Leaning north, one guard north."""
    return turned(turned(LEVEL, (0.0, -1.0, 0.0), math.radians(degrees)), (0.0, 0.0, 1.0), math.radians(45.0))


def turned_by(push_ned_m_s, place_ned_m, attitude_wxyz):
    """Change of the body rates, by angular momentum."""
    push, place = (np.array(ned_to_body(attitude_wxyz, tuple(v))) for v in (push_ned_m_s, place_ned_m))
    return tuple(np.cross(place, push) / np.array(GUARDS.gyration_frd_m) ** 2)


@pytest.mark.parametrize("lean_deg, down_m_s", [(10.0, -0.25), (-10.0, 0.25), (0.0, 0.0)])
def test_what_leans_into_a_wall_is_thrown_up_and_what_leans_away_down(lean_deg, down_m_s):
    # Given 1.5 m/s square into a stiff wall, met by the edge of the foremost hoop that leans into it
    attitude, lean = nose_down(lean_deg), math.radians(lean_deg)
    reach, edge = GUARDS.centre_m + GUARDS.radius_m, 0.5 * GUARDS.height_m * np.clip(lean_deg / 5.7, -1.0, 1.0)
    place = (reach * math.cos(lean) + edge * math.sin(lean), 0.0, reach * math.sin(lean) - edge * math.cos(lean))
    # When it pushes back and, by friction, up or down
    change = turned_by((-1.9 * 1.5, 0.0, down_m_s), place, attitude)
    throw = thrown(Approach(attitude, ZERO, (1.5, 0.0, 0.0)), SOUTH, change, STIFF_RESTITUTION, GUARDS)
    # Then the turn that gyroscopes show tells how much
    assert throw is not None
    assert throw.down_m_s == pytest.approx(down_m_s, abs=0.07)
    assert abs(throw.down_m_s - down_m_s) < 2.0 * throw.spread_m_s < 0.3


def test_a_spin_is_no_throw():
    # Given a guard beside the middle that a pole pushes back, level: the vehicle spins with 10 rad/s and more
    place = (0.1, 0.1, 0.0)
    change = turned_by((-1.0, 0.0, 0.0), place, LEVEL)
    throw = thrown(Approach(LEVEL, ZERO, (1.4, 0.0, 0.0)), SOUTH, change, STIFF_RESTITUTION, GUARDS)
    assert throw is not None and abs(change[2]) > 10.0
    assert abs(throw.down_m_s) < 0.06


def test_a_normal_that_is_wrong_by_fifteen_degrees_costs_little_and_one_by_forty_five_makes_less_of_a_throw():
    attitude = nose_down(8.0)
    change = turned_by((-2.8, 0.0, -0.2), (0.225, 0.0, 0.0315 - 0.015), attitude)
    approach, throws = Approach(attitude, ZERO, (1.5, 0.0, 0.0)), []
    for askew_deg in (0.0, 15.0, 45.0):
        askew = (-math.cos(math.radians(askew_deg)), math.sin(math.radians(askew_deg)), 0.0)
        throw = thrown(approach, askew, change, STIFF_RESTITUTION, GUARDS)
        assert throw is not None
        throws.append(throw)
    right, wrong, far = throws
    assert right.down_m_s == pytest.approx(-0.2, abs=0.03)
    assert abs(wrong.down_m_s - right.down_m_s) < 0.06
    assert right.down_m_s < far.down_m_s < 0.0, "less is taken for a throw, not more"


def test_what_did_not_come_near_is_not_thrown():
    assert thrown(Approach(LEVEL, ZERO, (-1.0, 0.0, 0.0)), SOUTH, ZERO, STIFF_RESTITUTION, GUARDS) is None


def test_what_is_missing_in_an_estimate_is_put_right_as_a_filter_of_second_order_does():
    step, place, speed = 1e-4, 0.0, 1.0
    for count in range(12_000):
        if count % 1000 == 0:
            g, way = missing(count * step)
            assert (g, way) == (pytest.approx(speed, abs=2e-3), pytest.approx(place, abs=1e-3))
        is_corrected = count * step > 0.12
        slope = speed - (2.0 * 0.59 * 4.45 * place if is_corrected else 0.0)
        speed -= step * (4.45**2 * place if is_corrected else 0.0)
        place += step * slope


def test_how_an_estimate_is_put_right_tells_what_the_hit_hid_of_itself():
    # Given a vehicle that flies up with 0.3 m/s, of which nothing is known, and an estimate that says it falls with 0.2
    hit = Unseen(0.0, 0.0, 0.3)
    for number in range(1, 21):
        since_s = 0.02 * number
        g, way_s = missing(since_s)
        hit.told(since_s, -0.3 + 0.5 * g, -0.3 * since_s + 0.5 * way_s)
        if since_s <= 0.1:
            # Then at first nothing is told
            assert abs(hit.speed_m_s) < 1e-6
    # and is known once the estimate turns round
    assert hit.speed_m_s == pytest.approx(-0.3, abs=0.05)


def climbing(upwards_m_s2: float = 3.0) -> Climb:
    return Climb(1_000_000, 998_000, (1.5, 0.0, 0.0), GUARDS, upwards_m_s2, height_down_m=-2.0)


def heard(
    climb: Climb,
    down_m_s2: Callable[[int], float],
    until_us: int = 600_000,
    told_m_s: Callable[[int], float] | None = None,
) -> list[float]:
    """What is asked for every 4 ms after a stiff hit of 1.5 m/s that throws a leaning vehicle up with 0.25 m/s."""
    attitude = nose_down(10.0)
    change = turned_by((-2.85, 0.0, -0.25), (0.2216, 0.0, 0.0243), attitude)
    turns = [Attitude(990_000, attitude, ZERO)]
    strapdown, asked, speed_m_s = Strapdown(), [], 0.0
    for since_us in range(0, until_us, 4000):
        speed_m_s += 0.004 * down_m_s2(since_us)
        left = math.exp(-since_us / 50_000)
        strapdown.time_boot_us = 1_000_000 + since_us
        strapdown.rates_frd_rad_s = (left * change[0], left * change[1], left * change[2])
        # What the accelerometer makes of a contact that it clips counts for nothing.
        strapdown.acceleration_ned_m_s2 = (-150.0 if since_us == 0 else -3.0, 0.0, 0.0)
        strapdown.sum_ned_m_s = (0.0, 0.0, speed_m_s + (0.2 if since_us else 0.0))
        told_us = 0 if told_m_s is None else strapdown.time_boot_us
        down_m_s = 0.0 if told_m_s is None else told_m_s(since_us)
        told = LocalPosition(told_us, (0.0, 0.0, -2.0 + down_m_s * since_us * 1e-6), (0.0, 0.0, down_m_s))
        climb.hear(strapdown, turns, 0, SOUTH, told)
        asked.append(climb.braking_m_s2())
    return asked


def test_a_throw_that_clipping_hid_is_braked_as_hard_as_a_vehicle_falls_and_no_longer():
    """The vehicle does what it is asked with 0.03 s of lag: the climb ends, and no fall comes of it."""
    climb, done = climbing(), [0.0]
    asked: list[float] = []

    def follows(since_us: int) -> float:
        done[0] += 4 / 30 * (climb.asked_m_s2 - done[0])
        asked.append(climb.asked_m_s2)
        return done[0] if since_us else 0.0

    heard(climb, follows, until_us=440_000)
    assert climb.throw.down_m_s == pytest.approx(-0.25, abs=0.05)
    assert max(asked) > 0.9 * FALLING_MOST_M_S2
    assert abs(climb.speed_m_s) < 0.03
    assert -0.03 < climb.fallen_m < 0.0
    assert asked[-1] == pytest.approx(0.0, abs=0.5)


def test_a_climb_that_is_not_to_be_braked_is_not():
    climb = climbing(upwards_m_s2=0.0)
    heard(climb, lambda _: 0.0, until_us=12_000)
    assert not climb.is_reckoned


def test_half_a_second_later_the_estimate_counts():
    """What was reckoned of the hit may be wrong by 0.1 m/s, which grows to a decimetre."""
    climb = climbing()
    heard(climb, lambda _: 0.0, until_us=440_000)
    reckoned_m_s = climb.speed_m_s
    heard(again := climbing(), lambda _: 0.0, until_us=600_000, told_m_s=lambda _: 0.0)
    assert reckoned_m_s < -0.2
    assert abs(again.speed_m_s) < 0.2 * abs(reckoned_m_s)


def test_height_is_the_only_thing_that_levelling_changes():
    motion = Motion((1.0, 2.0, -3.0), (0.5, 0.6, 0.7), (0.1, 0.2, 0.3))
    assert level(motion, -2.0, 1.5) == Motion((1.0, 2.0, -2.0), (0.5, 0.6, 0.0), (0.1, 0.2, 1.5))
    assert level(Motion((1.0, 2.0, -3.0)), -2.0, 0.0) == Motion((1.0, 2.0, -2.0))
