"""Identification: what the simulated vehicle is known to have is found again; bad data end in one sentence."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

from bench.fly.cruise import head_on
from rebound_cli.documents import load_document, validated
from rebound_cli.identification.capture import find_hit, read_table
from rebound_cli.identification.fit import fit_friction, fit_restitution, fit_spring
from rebound_cli.identification.hit import IdentificationError
from sim_vehicle.airframe import Airframe, load_built_in, with_base
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.rebound_cli.command import WALL, assert_one_clear_sentence, run_here

RATE_HZ = 120
NOISE_M = 0.0003
HEIGHT_M = 5.0
HEADER = ("time_s", "position_x_m", "position_y_m", "yaw_rad")


def thrown(airframe, speed_m_s, yaw_rad=0.0, east_m_s=0.0):
    """Time and horizontal path of a vehicle thrown at a wall, motors off, at the top of its arc when it meets it."""
    wall = {"point_ned_m": [0, 0, -HEIGHT_M], "normal_ned": [-1, 0, 0], "width_m": 20, "height_m": 20}
    plant = Plant(airframe, Scene.model_validate({"walls": [wall]}), seed=1)
    if yaw_rad:
        plant.state.body[6], plant.state.body[9] = np.cos(yaw_rad / 2), np.sin(yaw_rad / 2)
    distance_m = 0.35 + 0.25 * speed_m_s
    up_m_s = 9.81 * (distance_m - 0.18) / speed_m_s
    plant.place((-distance_m, 0.0, -HEIGHT_M), (speed_m_s, east_m_s, -up_m_s))
    for _ in range(200):
        plant.step(None, armed=False)
    series = plant.truth.series()
    return 1e-6 * series["time_boot_us"], series["position_ned_m"][:, :2]


def write_capture(path, time_s, position_m, yaw_rad=0.0, seed=1, arrival=lambda t: t):
    """Motion capture of a path: 120 Hz, with noise, stamped on arrival."""
    rng = np.random.default_rng(seed)
    samples_s = np.arange(time_s[0], time_s[-1], 1 / RATE_HZ)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(HEADER)
        for at_s in samples_s:
            x_m, y_m = (
                np.interp(at_s, time_s, position_m[:, axis]) + NOISE_M * rng.standard_normal() for axis in (0, 1)
            )
            writer.writerow([arrival(at_s), x_m, y_m, yaw_rad])
    return path


def without_friction(name):
    data = load_built_in(name).model_dump()
    data["drag_n_s_m"], data["surface"]["guard_friction"] = 0.0, 0.0
    return Airframe.model_validate(data)


def test_the_springs_of_the_foldable_vehicle_are_found_again(tmp_path):
    # Given motion capture of three hits below the stop
    airframe = without_friction("foldable")
    hits = []
    for seed, speed_m_s in enumerate((0.7, 1.0, 1.3)):
        file = write_capture(tmp_path / f"{speed_m_s}.csv", *thrown(airframe, speed_m_s), seed=seed)
        hits.append(find_hit(read_table(file)))
    # When the springs are fitted
    spring = fit_spring(hits)
    # Then both are the airframe's, and its ratio of speeds is eq. 2's
    assert spring.stiffness_per_s2.value == pytest.approx(500, rel=0.05)
    assert spring.damping_per_s.value == pytest.approx(30, rel=0.05)
    assert abs(spring.stiffness_per_s2.value - 500) < 3 * spring.stiffness_per_s2.sigma
    assert fit_restitution(hits).value == pytest.approx(0.22, abs=0.015)


def test_the_sigma_of_a_single_hits_damping_is_how_far_it_scatters(tmp_path):
    # Given one hit, captured two dozen times with other noise
    path = thrown(without_friction("foldable"), 1.0)
    springs = [
        fit_spring([find_hit(read_table(write_capture(tmp_path / "hit.csv", *path, seed=n)))]) for n in range(24)
    ]
    # Then b_s scatters by what each says of itself: frequency and damping ratio, found together, go together
    scatter = np.std([spring.damping_per_s.value for spring in springs], ddof=1)
    assert np.mean([spring.damping_per_s.sigma for spring in springs]) == pytest.approx(scatter, rel=0.2)


def test_one_guard_is_half_a_spring(tmp_path):
    # Given a hit with the nose turned by 45 degrees, on one guard
    yaw_rad = np.pi / 4
    file = write_capture(
        tmp_path / "diagonal.csv", *thrown(without_friction("foldable"), 0.6, yaw_rad=yaw_rad), yaw_rad=yaw_rad
    )
    hit = find_hit(read_table(file))
    # Then the guard is counted and the airframe's own numbers come out, not their halves
    assert hit.guards == 1
    assert fit_spring([hit]).stiffness_per_s2.value == pytest.approx(500, rel=0.1)
    assert fit_spring([hit]).damping_per_s.value == pytest.approx(30, rel=0.1)


def test_a_rigid_vehicle_has_a_restitution_and_no_spring(tmp_path):
    airframe = without_friction("rigid")
    file = write_capture(tmp_path / "rigid.csv", *thrown(airframe, 1.2))
    hit = find_hit(read_table(file))
    # A contact of 1 ms lies between two samples: any stiff spring would fit.
    assert fit_spring([hit]) is None
    truth = head_on(airframe, 1.2).hit
    assert fit_restitution([hit]).value == pytest.approx(truth.rebound_speed_m_s / 1.2, abs=0.02)
    assert fit_restitution([hit]).value == pytest.approx(0.9, abs=0.02)


def test_friction_along_the_wall(tmp_path):
    # Given a hit that slides throughout: 4 m/s along the wall, 1 m/s at it
    data = load_built_in("rigid").model_dump()
    data["drag_n_s_m"], data["surface"]["guard_friction"] = 0.0, 0.15
    airframe = Airframe.model_validate(data)
    file = write_capture(tmp_path / "slide.csv", *thrown(airframe, 1.0, east_m_s=4.0))
    friction = fit_friction([find_hit(read_table(file), axis=0)])
    assert friction.value == pytest.approx(airframe.surface.guard_friction, abs=0.03)


def test_stamps_of_a_poller_are_made_even(tmp_path):
    # Given 120 Hz of motion capture stamped by a recorder that looks 100 times a second
    path_s, path_m = thrown(without_friction("foldable"), 1.0)
    even = write_capture(tmp_path / "even.csv", path_s, path_m)
    polled = write_capture(tmp_path / "polled.csv", path_s, path_m, arrival=lambda t: np.ceil(t * 100) / 100)
    # Then the speeds are the same as with true stamps
    expected, hit = find_hit(read_table(even)), find_hit(read_table(polled))
    assert hit.speed_in_m_s == pytest.approx(expected.speed_in_m_s, rel=0.03)
    assert hit.speed_out_m_s == pytest.approx(expected.speed_out_m_s, abs=0.02)


def test_the_wall_may_stand_on_either_side_of_either_axis(tmp_path):
    path_s, path_m = thrown(without_friction("foldable"), 1.0)
    ratios = []
    for turned in (path_m, -path_m, path_m[:, ::-1], -path_m[:, ::-1]):
        ratios.append(find_hit(read_table(write_capture(tmp_path / "turned.csv", path_s, turned))).ratio)
    assert ratios == pytest.approx([ratios[0]] * 4, abs=0.02)


def test_a_flight_becomes_an_airframe(wall_flight, tmp_path):
    # Given a flight of the foldable vehicle into the wall, above the speed that reaches the stop
    folder, _ = wall_flight
    # When it is identified from its telemetry, whatever the file is called
    file = tmp_path / "a: #b.yaml"
    identified = run_here("identify", folder, "--out", file, "--name", 'an "own": vehicle')
    assert identified.returncode == 0, identified.stderr
    # Then the file has the vehicle's springs and stop
    document = load_document(file)
    assert document.data["name"] == 'an "own": vehicle'
    airframe = validated(Airframe, document, with_base(document.data))
    assert airframe.mass_kg == 1.112
    assert airframe.arms.damping_per_s == pytest.approx(30, rel=0.1)
    assert airframe.arms.stiffness_per_s2 == pytest.approx(500, rel=0.3)
    assert airframe.arms.fold_max_m == pytest.approx(0.03, abs=0.005)


@pytest.mark.slow
def test_an_identified_airframe_flies_the_same_mission(wall_flight, tmp_path):
    assert run_here("identify", wall_flight[0], "--out", tmp_path / "found.yaml").returncode == 0
    again = run_here("fly", WALL, "--lockstep", "--airframe", tmp_path / "found.yaml", "--out", tmp_path / "again")
    assert again.returncode == 0, again.stderr
    assert json.loads((tmp_path / "again" / "summary.json").read_text())["recontacts"] == 0


def test_a_table_without_a_column_is_one_clear_sentence(tmp_path):
    no_column = tmp_path / "no_column.csv"
    no_column.write_text("time_s,position_x_m\n0,1\n")
    assert_one_clear_sentence(run_here("identify", no_column), no_column, "position_y_m")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "column names"),
        ("time_s,position_x_m,position_y_m\n0,0,0\n", "only 1 rows"),
        ("time_s,a/position/x,b/position/x,position_y_m\n0,0,0,0\n", "2 columns end in position/x"),
    ],
)
def test_a_table_that_is_none(tmp_path, text, words):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(IdentificationError, match=words):
        read_table(file)


def test_a_column_of_times_that_is_none(tmp_path):
    file = tmp_path / "standing.csv"
    file.write_text("time_s,position_x_m,position_y_m\n" + "".join(f"1.0,{0.01 * row},0\n" for row in range(100)))
    with pytest.raises(IdentificationError, match="no hit found"):
        find_hit(read_table(file))


def test_a_flight_without_a_hit(tmp_path):
    # Given a vehicle that brakes at 3 m/s2 and flies back
    time_s = np.arange(0, 2, 0.004)
    path_m = np.column_stack([1.5 * time_s - 1.5 * np.maximum(0, time_s - 0.5) ** 2, 0 * time_s])
    file = write_capture(tmp_path / "braking.csv", time_s, path_m)
    with pytest.raises(IdentificationError, match="no hit found"):
        find_hit(read_table(file), axis=0)


FOLDER = os.environ.get("REBOUND_DATA")


@pytest.mark.skipif(FOLDER is None, reason="REBOUND_DATA does not name a folder with wall_hits/*.csv")
def test_real_wall_hits_show_a_spring_and_friction():
    # Given four hits of a 1.23 kg quadrotor, motion capture at 120 Hz
    files = sorted((Path(FOLDER) / "wall_hits").glob("*.csv"))
    hits = [find_hit(read_table(file)) for file in files]
    assert [hit.guards for hit in hits] == [2, 1, 2, 1]  # aligned, not aligned, aligned, not aligned
    assert all(0.4 < hit.ratio < 0.75 for hit in hits)
    assert 10_000 < fit_spring(hits).stiffness_per_s2.value < 25_000
    assert fit_friction(hits).value == pytest.approx(0.2, abs=0.1)
