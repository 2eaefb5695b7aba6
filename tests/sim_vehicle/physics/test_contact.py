"""Contact with walls: eq. 2 and its stop, energy, symmetry, and that a wall never pulls."""

import math

import numpy as np
import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import closed_form_of_eq_2, first_hit, motors_off, quiet, throw

# The two airframes of the paper without noise.
FOLDABLE, RIGID = (quiet(load_built_in(name)) for name in ("foldable", "rigid"))


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0, 1.4])
def test_head_on_hit_below_the_stop_follows_eq_2(speed_m_s: float) -> None:
    hit = first_hit(FOLDABLE, speed_m_s)
    rebound, contact_s, fold_m = closed_form_of_eq_2(FOLDABLE, speed_m_s)
    assert hit.rebound_speed_m_s == pytest.approx(rebound, rel=0.005)
    assert hit.contact_duration_s == pytest.approx(contact_s, rel=0.005)
    assert hit.max_fold_m == pytest.approx(fold_m, rel=0.005)


def test_the_stop_is_met_above_1_43_m_s() -> None:
    below, above = first_hit(FOLDABLE, 1.42), first_hit(FOLDABLE, 1.45)
    assert below.max_fold_m < FOLDABLE.arms.fold_max_m < above.max_fold_m
    # Without the stop the force never exceeds its first value, m b_s v; the stop is what makes peaks.
    assert below.peak_force_n == pytest.approx(FOLDABLE.mass_kg * FOLDABLE.arms.damping_per_s * 1.42, rel=0.01)


@pytest.mark.parametrize("speed_m_s", [1.0, 2.0, 3.0])
def test_rigid_contact_takes_a_millisecond_and_returns_nine_tenths(speed_m_s: float) -> None:
    hit = first_hit(RIGID, speed_m_s)
    assert hit.contact_duration_s == pytest.approx(0.001, rel=0.03)
    assert hit.rebound_speed_m_s / speed_m_s == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("name", ["foldable", "rigid"])
@pytest.mark.parametrize("speed_m_s", [1.0, 2.5, 5.0])
def test_halving_the_step_changes_the_rebound_by_less_than_a_hundredth(name: str, speed_m_s: float) -> None:
    airframe = quiet(load_built_in(name))
    coarse, fine = first_hit(airframe, speed_m_s), first_hit(airframe, speed_m_s, fine_steps=20)
    assert coarse.rebound_speed_m_s == pytest.approx(fine.rebound_speed_m_s, rel=0.01)


def test_mirrored_hits_turn_the_vehicle_opposite_ways() -> None:
    left = throw(FOLDABLE, 1.0, yaw_rad=math.radians(15), duration_s=0.108).state.body
    right = throw(FOLDABLE, 1.0, yaw_rad=math.radians(-15), duration_s=0.108).state.body
    assert abs(left[12]) > 0.5
    assert left[12] == pytest.approx(-right[12], rel=1e-6)


@pytest.mark.parametrize("lean_deg", [-6.0, 6.0])
def test_a_leaning_hoop_touches_with_its_forward_edge(lean_deg: float) -> None:
    """Leaning 6 degrees, the front of a flat disc is 1.9 cm off the centre's height; the hoop's edge takes back 1.5."""

    def spun(airframe: Airframe) -> float:
        wall = {"point_ned_m": [2, 0, -3], "normal_ned": [-1, 0, 0]}
        plant = Plant(airframe, Scene.model_validate({"walls": [wall]}), seed=1)
        plant.place((1.7, 0.0, -3.0), (2.0, 0.0, 0.0))
        half = math.radians(lean_deg) / 2
        plant.state.body[6:10] = [math.cos(half), 0.0, math.sin(half), 0.0]
        assert motors_off(plant, 0.16).truth.hits
        return float(plant.state.body[11])

    smooth = quiet(FOLDABLE, surface__guard_friction=0.0)
    flat = quiet(smooth, geometry__guard_height_m=0.0)
    # Nose down the front is hit below the centre, which turns the nose further down; nose up the other way.
    assert math.copysign(1.0, spun(flat)) == math.copysign(1.0, lean_deg)
    assert abs(spun(smooth)) < 0.5 * abs(spun(flat))


def test_a_wall_only_pushes() -> None:
    """Released arms stay folded for a while; nothing draws the vehicle back to the wall."""
    series = throw(FOLDABLE, 2.0).truth.series()
    speed_away = -series["velocity_ned_m_s"][:, 0]
    touching = series["peak_contact_force_n"] > 0
    assert (np.diff(speed_away)[~touching[1:]] == 0).all()
    assert (np.diff(speed_away)[touching[1:]] > -1e-9).all()


@pytest.mark.parametrize("rate_rad_s", [0.0, 0.05, -0.3])
def test_a_turning_vehicle_is_pushed_from_the_first_touch_on(rate_rad_s: float) -> None:
    """The force of eq. 2 begins with m b_s v at once, however the vehicle turns as it touches."""
    truth = throw(FOLDABLE, 1.0, rates_frd_rad_s=(0.0, rate_rad_s, 0.0)).truth
    hit, series = truth.hits[0], truth.series()
    before = int(np.searchsorted(series["time_boot_us"], hit.contact_at_boot_us)) - 1
    slowed_m_s = series["velocity_ned_m_s"][before, 0] - series["velocity_ned_m_s"][before + 1, 0]
    touched_s = 1e-6 * (series["time_boot_us"][before + 1] - hit.contact_at_boot_us)
    assert slowed_m_s == pytest.approx(FOLDABLE.arms.damping_per_s * touched_s, rel=0.06, abs=0.001)
    assert hit.impact_velocity_ned_m_s[0] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_along_the_wall_is_coulombs(friction: float) -> None:
    """A guard hit square on while the vehicle slides east: what the wall takes along is the coefficient times
    what it gives across (through the centre of mass, so that nothing turns but slowly)."""
    airframe = quiet(load_built_in("foldable"), surface__guard_friction=friction, inertia_kg_m2=(9.0, 9.0, 9.0))
    wall = {"point_ned_m": [2, 0, -2], "normal_ned": [-1, 0, 0]}
    plant = Plant(airframe, Scene.model_validate({"walls": [wall]}), seed=1)
    plant.state.body[0:6] = [1.5, 0.0, -2.0, 1.0, 2.0, 0.0]
    (hit,) = motors_off(plant, 0.5).truth.hits
    across = hit.impact_velocity_ned_m_s[0] - hit.rebound_velocity_ned_m_s[0]
    along = hit.impact_velocity_ned_m_s[1] - hit.rebound_velocity_ned_m_s[1]
    fallen = hit.rebound_velocity_ned_m_s[2] - hit.impact_velocity_ned_m_s[2]
    upward = 9.81 * hit.contact_duration_s - fallen
    assert math.hypot(along, upward) == pytest.approx(friction * across, rel=0.02)
    assert along > 0
