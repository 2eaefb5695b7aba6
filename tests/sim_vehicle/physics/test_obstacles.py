"""Poles, edges, boxes, level plates and things that move: geometry, symmetry, and that no energy comes of them."""

import math

import numpy as np
import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from tests.sim_vehicle.physics.throwing import quiet, thrown

HEIGHT_M = 8.0
POLE = {"poles": [{"point_ned_m": [2, 0, 0], "radius_m": 0.1, "height_m": 30}]}
SCENES = {
    "pole": POLE,
    "slanted pole": {"poles": [{"point_ned_m": [-0.4, -4, 0], "axis_ned": [0.3, 0.5, -1], "radius_m": 0.05,
                                "height_m": 30}]},
    "bar": {"poles": [{"point_ned_m": [2, -3, -8], "axis_ned": [0, 1, 0], "radius_m": 0.03, "height_m": 6}]},
    "upright edge": {"walls": [{"point_ned_m": [2, 1, -8], "normal_ned": [-1, 0, 0], "width_m": 2, "height_m": 6,
                                "thickness_m": 0.02}]},
    "ledge": {"walls": [{"point_ned_m": [3, 0, -8], "normal_ned": [0, 0, 1], "width_m": 2, "height_m": 2,
                         "thickness_m": 0.04}]},
    "box": {"boxes": [{"centre_ned_m": [2.5, 0.3, -8], "size_m": [1, 0.6, 0.8], "yaw_deg": 20}]},
}  # fmt: skip


def smooth(name: str) -> Airframe:
    return quiet(load_built_in(name), surface__guard_friction=0.0)


@pytest.mark.parametrize("offset_m", [0.0, 0.03, 0.1, 0.2, -0.25])
def test_a_poles_normal_is_radial_where_the_guard_touches_it(offset_m: float) -> None:
    (hit, *_) = thrown(smooth("rigid"), POLE, (1.5, offset_m, -HEIGHT_M)).truth.hits
    off_axis = np.array(hit.contact_point_ned_m)[:2] - [2.0, 0.0]
    assert hit.kind == "pole"
    assert np.linalg.norm(off_axis) == pytest.approx(0.1, abs=1e-6)
    assert np.array(hit.normal_ned) == pytest.approx([*(off_axis / 0.1), 0.0], abs=1e-6)
    # and the guard's middle lies along it, its radius away
    arm_m = 0.145 / math.sqrt(2)
    guard = np.array(hit.contact_point_ned_m)[:2] + 0.08 * np.array(hit.normal_ned)[:2]
    centre = np.array(hit.contact_position_ned_m)[:2]
    assert np.abs(guard - centre) == pytest.approx(np.array([arm_m, arm_m]), abs=2e-4)


def test_what_is_round_is_solid_however_thick_it_is() -> None:
    for radius_m in (0.005, 2.0, 100.0):
        silo = {"poles": [{"point_ned_m": [2.0 + radius_m, 0, 0], "radius_m": radius_m, "height_m": 300}]}
        (hit, *_) = thrown(smooth("rigid"), silo).truth.hits
        assert hit.contact_point_ned_m[0] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", ["foldable", "rigid"])
def test_no_obstacle_returns_more_energy_than_it_took(name: str, scene: str) -> None:
    """Whatever part meets it, leaning and tumbling: kinetic energy and height together only fall."""
    airframe, rng, hits = smooth(name), np.random.default_rng(4), 0
    for number in range(16):
        plant = thrown(
            airframe,
            SCENES[scene],
            (1.5, rng.uniform(-0.3, 0.3), -HEIGHT_M - rng.uniform(0.0, 0.3)),
            (rng.uniform(2, 4), rng.uniform(-1, 1), rng.uniform(-1, 1)),
            rng.uniform(-3, 3),
            rng.uniform(-3, 3, 3) * (number % 2),
            rng.uniform(-0.25, 0.25, 2) * (number % 3 == 0),
            duration_s=0.4,
        )
        series = plant.truth.series()
        for hit in plant.truth.hits:
            start_m, end_m = (
                np.interp(time_us, series["time_boot_us"], series["position_ned_m"][:, 2])
                for time_us in (hit.contact_at_boot_us, hit.ended_at_boot_us)
            )
            gained_j = hit.energy_after_j - hit.energy_before_j - airframe.mass_kg * 9.81 * (end_m - start_m)
            assert gained_j < 5e-4 * hit.energy_before_j
            hits += 1
    assert hits >= 4


def test_a_ceiling_is_hit_from_below_and_a_floor_from_above() -> None:
    level = {"walls": [{"point_ned_m": [0, 0, -9], "normal_ned": [0, 0, 1], "name": "lid"},
                       {"point_ned_m": [0, 0, -4], "normal_ned": [0, 0, -1], "name": "deck"}]}  # fmt: skip
    (up,) = thrown(smooth("foldable"), level, (0, 0, -8.5), (0, 0, -4.0), duration_s=0.3).truth.hits
    assert (up.obstacle, up.kind, up.normal_ned) == ("lid", "ceiling", (0.0, 0.0, 1.0))
    assert up.rebound_velocity_ned_m_s[2] > 0
    (down, *_) = thrown(smooth("foldable"), level, (0, 0, -5.0), (0, 0, 2.0)).truth.hits
    assert (down.obstacle, down.kind, down.normal_ned) == ("deck", "floor", (0.0, 0.0, -1.0))
    # It lands on its feet, 8 cm below the centre.
    assert down.contact_position_ned_m[2] == pytest.approx(-4.08, abs=1e-3)


def test_the_rim_of_a_plate_is_solid() -> None:
    """Flown at the upright edge of a plate seen end-on, a vehicle is stopped; beside it, it passes."""
    plate = {"walls": [{"point_ned_m": [3, 0.05, -HEIGHT_M], "normal_ned": [0, 1, 0], "width_m": 2, "height_m": 6}]}
    (hit, *_) = thrown(smooth("rigid"), plate).truth.hits
    assert hit.kind == "edge"
    assert hit.rebound_velocity_ned_m_s[0] < 0
    passed = thrown(smooth("rigid"), plate, (1.5, 0.3, -HEIGHT_M), duration_s=0.8)
    assert passed.truth.hits == []
    assert passed.state.body[0] > 3.0


def test_from_rim_to_face_nothing_jumps() -> None:
    """Touching nearer and nearer to a plate's upright edge, the hit changes little by little."""
    plate = {"walls": [{"point_ned_m": [2, 1.0, -HEIGHT_M], "normal_ned": [-1, 0, 0], "width_m": 2, "height_m": 6}]}
    airframe = quiet(smooth("foldable"), inertia_kg_m2=(9.0, 9.0, 9.0))
    speeds = [
        thrown(airframe, plate, (1.5, offset_m, -HEIGHT_M), yaw_rad=math.pi / 4).state.body[3]
        for offset_m in np.arange(-0.02, 0.14, 0.01)
    ]
    assert np.abs(np.diff(speeds, 2)).max() < 0.1
    # Beyond the rim the face alone pushes: the same hit wherever it is.
    assert np.ptp(speeds[-8:]) < 0.01
    assert speeds[-1] < -0.1


@pytest.mark.parametrize("name", ["foldable", "rigid"])
@pytest.mark.parametrize("kind", ["walls", "poles"])
def test_a_moving_obstacle_hits_as_a_standing_one_is_hit(name: str, kind: str) -> None:
    """Seen from the obstacle a hit is the same whichever of the two moves; only the fall differs by none."""
    moves_m_s = np.array([-2.0, 0.3, -0.2])
    moving = {"motion": {"velocity_ned_m_s": moves_m_s.tolist(), "from_s": 0.0, "until_s": 5.0}}
    obstacle = {
        "walls": {"point_ned_m": [2, 0, -HEIGHT_M], "normal_ned": [-1, 0, 0]},
        "poles": {"point_ned_m": [2, 0.03, 0], "radius_m": 0.1, "height_m": 30},
    }[kind]
    standing = thrown(smooth(name), {kind: [obstacle]}, velocity=-moves_m_s, duration_s=0.3)
    hovering = thrown(smooth(name), {kind: [obstacle | moving]}, velocity=(0.0, 0.0, 0.0), duration_s=0.3)
    (at_rest, *_), (run_over, *_) = standing.truth.hits, hovering.truth.hits
    assert run_over.surface_velocity_ned_m_s == pytest.approx(moves_m_s, abs=1e-9)
    assert np.array(hovering.state.body[3:6]) - moves_m_s == pytest.approx(standing.state.body[3:6], abs=0.01)
    assert run_over.contact_at_boot_us == pytest.approx(at_rest.contact_at_boot_us, abs=30)
    assert run_over.energy_after_j / run_over.energy_before_j == pytest.approx(
        at_rest.energy_after_j / at_rest.energy_before_j, rel=0.01
    )
