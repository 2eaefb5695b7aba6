"""Obstacles that come and go, plates that strike, and the truth of it, in lockstep."""

import math
from typing import Any

import numpy as np
import pytest

from sim_vehicle.errors import ParameterError, SceneError
from sim_vehicle.testing import LockstepVehicle, Motion, Pole, Wall, faults
from tests.sim_vehicle.bench.pilot import Pilot, hovering

HOVER_M = 2.5


def pushed_north(pilot: Pilot) -> None:
    """Shove the vehicle away at more than 2 m/s."""
    pilot.vehicle.inject(faults.other("push", force_ned_n=(9, 0, 0), rise_s=0.0), for_s=0.3)


def test_a_second_obstacle_during_a_contact_leaves_the_contact_what_it_is() -> None:
    """The pole's row in the world moves on when a wall comes before it."""

    def hit(places_more: bool) -> Any:
        pilot = hovering(obstacles=[Pole(point_ned_m=(0.6, 0.0, 0), name="mast")])
        pushed_north(pilot)
        pilot.vehicle.advance_until(lambda truth: max(truth.arm_fold_m) > 0.003, 3.0)
        if places_more:
            pilot.vehicle.place(Wall(point_ned_m=(-5, 0, 0), normal_ned=(1, 0, 0), name="far"))
        pilot.vehicle.advance_until(lambda truth: truth.hits, 1.0)
        return pilot.vehicle.truth.hits[0]

    assert hit(True) == hit(False)


def test_an_obstacle_removed_during_a_contact_ends_it() -> None:
    pilot = hovering()
    wall = pilot.vehicle.place(Wall(point_ned_m=(0.6, 0, -HOVER_M), normal_ned=(-1, 0, 0)))
    pushed_north(pilot)
    pilot.vehicle.advance_until(lambda truth: max(truth.arm_fold_m) > 0.003, 3.0)
    wall.remove()
    (hit,) = pilot.vehicle.truth.hits
    assert hit.obstacle == "wall 1"
    # Arms fold by 3 cm at most: with the wall there it would not get so far
    beyond_m = hit.contact_position_ned_m[0] + 0.06
    pilot.vehicle.advance_until(lambda truth: truth.position_ned_m[0] > beyond_m, 1.0)


def test_a_motion_counts_from_the_moment_of_placing() -> None:
    pilot = hovering()
    pilot.vehicle.place(
        Wall(
            point_ned_m=(1.2, 0, -HOVER_M),
            normal_ned=(-1, 0, 0),
            motion=Motion(velocity_ned_m_s=(-1.0, 0, 0), from_s=0.5, until_s=1.6),
        )
    )
    placed_s = pilot.vehicle.time_s
    pilot.vehicle.advance_until(lambda truth: truth.hits, 4.0)
    (hit,) = pilot.vehicle.truth.hits
    assert hit.surface_velocity_ned_m_s == pytest.approx((-1, 0, 0), abs=1e-6)
    assert hit.contact_at_boot_us / 1e6 - placed_s == pytest.approx(0.5 + 1.2 - 0.1825, abs=0.1)


@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, 180.0, -45.0])
@pytest.mark.parametrize("airframe", ["foldable", "rigid"])
def test_a_strike_comes_from_where_and_as_fast_as_asked(airframe: str, bearing_deg: float) -> None:
    pilot = hovering(airframe=airframe, yaw_deg=30.0)
    begun_s = pilot.vehicle.time_s
    name = pilot.vehicle.hit(1.5, bearing_deg=bearing_deg)
    pilot.fly(1.0)
    (hit,) = pilot.vehicle.truth.hits
    assert hit.obstacle == name == "strike 1"
    heading = math.radians(30.0 + bearing_deg)
    assert hit.normal_ned == pytest.approx((-math.cos(heading), -math.sin(heading), 0), abs=0.03)
    assert hit.closing_speed_m_s == pytest.approx(1.5, abs=0.05)
    assert hit.contact_at_boot_us / 1e6 - begun_s == pytest.approx(0.02, abs=0.01)
    # Kicked away from where the plate came from, and nothing is left of that plate
    assert np.dot(hit.rebound_velocity_ned_m_s, hit.normal_ned) > 1.5
    pilot.fly(2.0)
    assert len(pilot.vehicle.truth.hits) == 1
    # A rigid frame hands on more than the accelerometer can show
    assert airframe == "foldable" or pilot.all("VIBRATION")[-1].clipping_0 > 0


def test_the_truth_is_neither_late_nor_noisy() -> None:
    """A standing vehicle's estimate wanders; the truth does not."""
    pilot = Pilot(LockstepVehicle(yaw_deg=90.0))
    pilot.fly(1.0)
    truth = pilot.vehicle.truth
    assert truth.time_boot_s == pilot.vehicle.time_s
    assert truth.position_ned_m[:2] == pytest.approx((0, 0), abs=1e-6) and truth.speed_m_s < 1e-6
    assert truth.attitude_wxyz == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-6)
    assert not truth.is_armed and truth.mode == "Hold" and truth.height_m == pytest.approx(0.08, abs=0.01)
    path = pilot.vehicle.recorded.series()
    assert path["time_boot_us"][-1] == round(1e6 * truth.time_boot_s)


def test_bad_setups_are_one_sentence() -> None:
    with pytest.raises(ParameterError, match="no parameter 'MPC_XY_CRUSE'"):
        LockstepVehicle(parameters={"MPC_XY_CRUSE": 3})
    with pytest.raises(SceneError, match=r"faults\.0\.motor_failure"):
        LockstepVehicle(faults=[{"kind": "motor_failure", "at_s": 1, "motor": 9}])
