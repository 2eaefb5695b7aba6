"""What the estimate makes of a hit of which the accelerometer's clipping hid a part."""

import numpy as np
import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.plant.plant import Plant
from tests.sim_vehicle.physics.throwing import quiet, throw

# As the built-in airframes, whose 0.12 s begin when an estimate 0.02 s late has seen the hit.
AS_PX4 = {"late_s": 0.14, "frequency_rad_s": 4.45, "damping": 0.59}


def airframe(name: str, clipping: dict[str, float] | None = AS_PX4) -> Airframe:
    return quiet(load_built_in(name), estimate__clipping=clipping, estimate__delay_s=0.0)


def error_after(plant: Plant) -> np.ndarray:
    """Position and velocity, NED."""
    return np.array(plant.state.estimate[:6] - plant.state.body[:6])


@pytest.mark.parametrize(("name", "speed_m_s"), [("rigid", 1.0), ("rigid", 3.0), ("foldable", 3.0)])
def test_what_clipping_hides_is_missing_in_the_velocity(name: str, speed_m_s: float) -> None:
    """Given a clipped hit, when it is over, then the estimate misses much of what the wall took, no more."""
    plant = throw(airframe(name), speed_m_s, gap_m=0.01, duration_s=0.08).plant
    taken_m_s = speed_m_s - plant.state.body[3]

    missed_m_s = error_after(plant)[3]

    assert 0.3 * speed_m_s < missed_m_s < taken_m_s


def test_a_hit_within_the_sensors_range_is_known_whole() -> None:
    """Given 0.3 m/s on springs, then nothing is missing."""
    assert error_after(throw(airframe("foldable"), 0.3).plant) == pytest.approx(np.zeros(6), abs=1e-12)


def test_without_the_effect_the_estimate_knows_all() -> None:
    assert error_after(throw(airframe("rigid", None), 3.0).plant) == pytest.approx(np.zeros(6), abs=1e-12)


def test_the_estimate_finds_back_as_a_real_px4_s_did() -> None:
    """Given a hit, then the velocity is wrong by as much for 0.14 s, by a third after 0.4 s, and right after 0.6 s."""
    at_first, soon, later, right, in_the_end = (
        error_after(throw(airframe("rigid"), 2.0, gap_m=0.02, duration_s=duration_s).plant)[3]
        for duration_s in (0.06, 0.14, 0.41, 0.6, 3.0)
    )

    assert soon == pytest.approx(at_first, rel=0.01)
    assert later == pytest.approx(at_first / 3, rel=0.1)
    assert abs(right) < 0.03 * at_first
    assert abs(in_the_end) < 0.02 * at_first


def test_the_place_errs_by_what_the_velocity_has_missed() -> None:
    """Given a hit to the north, then the estimate soon is inside the wall, and comes back."""
    inside_m = error_after(throw(airframe("rigid"), 2.0, duration_s=0.3).plant)[0]
    back_m = error_after(throw(airframe("rigid"), 2.0, duration_s=2.5).plant)[0]

    assert 0.3 < inside_m < 1.0
    assert abs(back_m) < 0.02


def test_a_late_estimate_misses_it_as_late_as_it_sees_the_hit() -> None:
    """Given an estimate 20 ms late, when the wall turns the vehicle round, then it does not leap ahead."""
    late = quiet(load_built_in("rigid"), estimate__clipping=AS_PX4, estimate__delay_s=0.02)
    for duration_s in (0.008, 0.012, 0.02, 0.032, 0.044):
        velocity_m_s = throw(late, 2.0, gap_m=0.01, duration_s=duration_s).plant.state.estimate[3]

        assert velocity_m_s < 2.01
