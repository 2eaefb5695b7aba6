"""A vehicle that spins: steered gently, its slow and turned lean brings it to rest."""

import cmath
import math

import pytest

from bench.random_missions.campaign import MissionCase, work_out_mission
from companion.flight.spinning import MOST_M_S2, Steering, coming_to_rest, spin_rad_s
from companion.messages import Attitude, LocalPosition

EVERY_S, G_M_S2 = 0.02, 9.80665
# An attitude loop of 12 rad/s, critically damped: k (z_d - z) = z'' + 2 sqrt(k) z' - 2 i r z', z the lean in the world
LOOP_RAD_S = 12.0


def leaning(acceleration_m_s2, spin_rad_s=0.0):
    """Nose north, leaning so as to accelerate (north + i east) while it carries its weight."""
    half = 0.5 * math.atan(abs(acceleration_m_s2) / G_M_S2)
    direction = cmath.phase(acceleration_m_s2) if acceleration_m_s2 else 0.0
    attitude = (math.cos(half), math.sin(half) * math.sin(direction), -math.sin(half) * math.cos(direction), 0.0)
    return Attitude(0, attitude, (0.0, 0.0, spin_rad_s))


def steered(spin_rad_s, speed_m_s, wind_m_s2=0.0, seconds=8.0, law=None):
    """Places (north + i east) of a gyroscope that is asked for the steering's accelerations, or for a law's."""
    place, speed, lean, turning = 0j, complex(speed_m_s), 0j, 0j
    goal = coming_to_rest((0.0, 0.0, -2.0), (speed_m_s, 0.0, 0.0), -2.0)
    steering, places = Steering(goal), []
    for step in range(round(seconds / EVERY_S)):
        sample = LocalPosition(
            1 + round(step * EVERY_S * 1e6), (place.real, place.imag, -2.0), (speed.real, speed.imag, 0)
        )
        steering.step(sample, leaning(lean, spin_rad_s))
        asked = complex(*steering.acceleration_m_s2) if law is None else law(place - goal[0], speed)
        assert abs(asked) <= MOST_M_S2 + 1e-9 or law is not None
        for _ in range(20):
            turning += 1e-3 * (LOOP_RAD_S**2 * (asked - lean) - 2 * LOOP_RAD_S * turning + 2j * spin_rad_s * turning)
            lean += 1e-3 * turning
            speed += 1e-3 * (lean + wind_m_s2)
            place += 1e-3 * speed
        places.append(place)
    return places, goal[0]


@pytest.mark.parametrize("spin_rad_s", [0.0, 8.0, -16.0, 20.0])
def test_a_spinning_vehicle_comes_to_rest(spin_rad_s):
    places, goal_m = steered(spin_rad_s, 2.5)
    assert max(abs(place - goal_m) for place in places[-50:]) < 0.15
    # and not far beyond
    assert max(place.real for place in places) < goal_m + 0.5
    assert max(abs(place.imag) for place in places) < 0.5


def test_a_quick_velocity_loop_would_throw_it_about():
    """What the steering is for: with PX4's place gain and the built-in vehicle's velocity gain it circles for ever."""
    places, goal_m = steered(16.0, 2.5, law=lambda off, speed: -4.0 * (speed + 0.95 * off))
    assert max(abs(place - goal_m) for place in places[-50:]) > 1.0


def test_a_wind_is_leant_against():
    # Given a wind of 4 m/s, which takes 1.1 m/s^2
    places, goal_m = steered(16.0, 0.0, wind_m_s2=1.1, seconds=10.0)
    assert abs(places[-1] - goal_m) < 0.3
    assert max(abs(place) for place in places) < 1.5


def test_the_spin_is_that_about_the_vertical():
    assert spin_rad_s(None) == 0.0
    assert spin_rad_s(Attitude(0, (1.0, 0.0, 0.0, 0.0))) == 0.0
    assert spin_rad_s(Attitude(0, (1.0, 0.0, 0.0, 0.0), (3.0, 0.0, -7.0))) == pytest.approx(7.0)
    # Nose up by a right angle, the body's x axis is upright
    assert spin_rad_s(Attitude(0, (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0), (3.0, 0.0, -7.0))) == pytest.approx(3.0)


def test_a_pole_that_spins_the_vehicle_for_seconds_does_not_sink_it():
    # Given a rigid vehicle, 1.6 m high, which a pole met at 2.8 m/s turns with 22 rad/s, 12 of them two seconds later
    flown = work_out_mission(MissionCase(seed=11512, airframe="rigid", feed_forward=True))
    assert flown["hits"][0]["kind"] == "pole" and flown["hits"][0]["speed_m_s"] > 2.5
    # Then it comes to rest and flies home
    assert flown["failures"] == []
    assert flown["hits"][0]["lost_m"] < 0.2
