"""What the estimate makes of a hit of which the accelerometer's clipping hid a part."""

import numpy as np
import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.plant.plant import Plant
from tests.sim_vehicle.physics.throwing import quiet, throw

# As the built-in airframes, whose 0.16 s begin when an estimate 0.02 s late has seen the hit.
AS_PX4 = {"late_s": 0.18, "frequency_rad_s": 4.65, "damping": 0.67, "tilt_per_s": 0.5}


def airframe(name: str, clipping: dict[str, float] | None = AS_PX4) -> Airframe:
    return quiet(load_built_in(name), estimate__clipping=clipping, estimate__delay_s=0.0)


def error_after(plant: Plant) -> np.ndarray:
    """Position and velocity, NED."""
    return np.array(plant.state.estimate[:6] - plant.state.body[:6])


@pytest.mark.parametrize(("name", "speed_m_s"), [("rigid", 1.0), ("rigid", 3.0), ("foldable", 5.0)])
def test_what_clipping_hides_is_missing_in_the_velocity(name: str, speed_m_s: float) -> None:
    """Given a clipped hit, when it is over, then the estimate misses much of what the wall took, no more."""
    plant = throw(airframe(name), speed_m_s, gap_m=0.01, duration_s=0.08)
    taken_m_s = speed_m_s - plant.state.body[3]

    missed_m_s = error_after(plant)[3]

    assert 0.3 * speed_m_s < missed_m_s < taken_m_s


def test_a_hit_within_the_sensors_range_is_known_whole() -> None:
    """Given 0.3 m/s on springs, then nothing is missing."""
    assert error_after(throw(airframe("foldable"), 0.3)) == pytest.approx(np.zeros(6), abs=1e-12)


def test_without_the_effect_the_estimate_knows_all() -> None:
    assert error_after(throw(airframe("rigid", None), 3.0)) == pytest.approx(np.zeros(6), abs=1e-12)


# Of what was hidden, what a real PX4's velocity lacked so long after the hit: the mean of fourteen, by motion capture.
LACKED = {0.1: 1.0, 0.3: 0.54, 0.4: 0.22, 0.5: -0.02, 0.7: -0.2, 1.0: -0.14, 1.4: -0.1, 2.0: -0.07, 3.0: -0.05}


def test_the_estimate_finds_back_as_a_real_px4_s_did() -> None:
    """Given a hit, then the velocity lacks what a real PX4's did."""
    hidden, *found = (
        error_after(throw(airframe("rigid"), 2.0, gap_m=0.02, duration_s=0.01 + duration_s))[3]
        for duration_s in (0.06, *LACKED)
    )

    assert [each / hidden for each in found] == pytest.approx([*LACKED.values()], abs=0.12)


def test_a_part_is_taken_for_a_tilt() -> None:
    """Given a clipped hit to the north, then 0.7 s later the vehicle takes itself for leaning back, and is not."""
    plant = throw(airframe("rigid"), 2.0, gap_m=0.02, duration_s=0.7)
    hidden_m_s = error_after(throw(airframe("rigid"), 2.0, gap_m=0.02, duration_s=0.07))[3]
    w, _, y, _ = plant.state.estimate[6:10]
    true_w, _, true_y, _ = plant.state.body[6:10]
    nose_up_rad = 2.0 * (np.arctan2(y, w) - np.arctan2(true_y, true_w))

    # 15 degrees of 7.8 m/s; with constant gains half as much again.
    assert 1.0 < nose_up_rad / (np.radians(15.0) * hidden_m_s / 7.8) < 1.5
