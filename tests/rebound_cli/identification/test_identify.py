"""Identification: what the simulated vehicle is known to have is found again; bad data end in one sentence."""

import json

import numpy as np
import pytest

from rebound_cli.documents import load_document, validated
from rebound_cli.identification.fit import fit_restitution, fit_spring
from rebound_cli.identification.hit import Hit, Push, guards_at
from sim_vehicle.airframe import Airframe, with_base
from tests.rebound_cli.command import WALL, run_here

# The paper's eq. 2 of the foldable vehicle.
STIFFNESS_PER_S2, DAMPING_PER_S = 500.0, 30.0


def pressed(speed_m_s, guards=2, noise_m_s2=0.0, seed=1):
    """A hit on a wall that cannot pull, as samples of 250 Hz show it."""
    share, step_s, depth_m, speed = guards / 2, 1e-5, 0.0, speed_m_s
    rows = []
    while not rows or rows[-1][3] > 0.0:
        push_m_s2 = share * (STIFFNESS_PER_S2 * depth_m + DAMPING_PER_S * speed)
        rows.append((len(rows) * step_s, depth_m, speed, push_m_s2))
        speed -= push_m_s2 * step_s
        depth_m += speed * step_s
    since_s, depth, speeds, pushes = np.array(rows[200:-1:400]).T
    noise = noise_m_s2 * np.random.default_rng(seed).standard_normal(len(pushes))
    return Hit("hit", 0.0, speed_m_s, -speed, 0.0, guards, Push(since_s, depth, speeds, pushes + noise))


@pytest.mark.parametrize("guards", [1, 2])
def test_the_springs_of_eq_2_are_found_again(guards):
    # Given three hits on as many guards, of which one is half a spring
    hits = [pressed(speed_m_s, guards) for speed_m_s in (0.7, 1.0, 1.3)]
    # Then both numbers are the whole vehicle's
    spring = fit_spring(hits)
    assert spring.stiffness_per_s2.value == pytest.approx(STIFFNESS_PER_S2, rel=0.01)
    assert spring.damping_per_s.value == pytest.approx(DAMPING_PER_S, rel=0.01)


def test_the_ratio_of_speeds_is_eq_2s():
    assert fit_restitution([pressed(1.0)]).value == pytest.approx(0.22, abs=0.015)


def test_the_sigma_of_a_single_hits_damping_is_how_far_it_scatters():
    # Given one hit, seen two hundred times with other noise
    springs = [fit_spring([pressed(1.0, noise_m_s2=0.3, seed=seed)]) for seed in range(200)]
    # Then b_s scatters by what each says of itself
    scatter = np.std([spring.damping_per_s.value for spring in springs], ddof=1)
    assert np.mean([spring.damping_per_s.sigma for spring in springs]) == pytest.approx(scatter, rel=0.3)


def test_a_contact_that_no_sample_resolves_has_a_restitution_and_no_spring():
    short = Hit("short", 0.0, 1.2, 0.9 * 1.2, 0.01, guards=2)
    assert fit_spring([short]) is None
    assert fit_restitution([short]).value == pytest.approx(0.9)


def test_the_guards_that_meet_the_wall():
    assert [guards_at(np.radians(degrees)) for degrees in (0, 20, 25, 45, 70, 90, -45, 180)] == [2, 2, 1, 1, 2, 2, 1, 2]


def test_a_flight_becomes_an_airframe(wall_flight, tmp_path):
    # Given a flight of the foldable vehicle into the wall, above the speed that reaches the stop
    folder, _ = wall_flight
    # When it is identified from its telemetry, whatever the file is called
    file = tmp_path / 'an "own": #vehicle.yaml'
    identified = run_here("identify", folder, "--out", file)
    assert identified.returncode == 0, identified.stderr
    # Then the file has the vehicle's springs and stop
    document = load_document(file)
    assert document.data["name"] == 'an "own": #vehicle'
    airframe = validated(Airframe, document, with_base(document.data))
    assert airframe.mass_kg == 1.112
    assert airframe.arms.damping_per_s == pytest.approx(DAMPING_PER_S, rel=0.1)
    assert airframe.arms.stiffness_per_s2 == pytest.approx(STIFFNESS_PER_S2, rel=0.3)
    assert airframe.arms.fold_max_m == pytest.approx(0.03, abs=0.005)


@pytest.mark.slow
def test_an_identified_airframe_flies_the_same_mission(wall_flight, tmp_path):
    assert run_here("identify", wall_flight[0], "--out", tmp_path / "found.yaml").returncode == 0
    again = run_here("fly", WALL, "--lockstep", "--airframe", tmp_path / "found.yaml", "--out", tmp_path / "again")
    assert again.returncode == 0, again.stderr
    assert json.loads((tmp_path / "again" / "summary.json").read_text())["recontacts"] == 0
