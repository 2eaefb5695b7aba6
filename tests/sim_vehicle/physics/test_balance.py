"""What a hit must conserve: momentum, energy, angular momentum; and the integrator's order."""

import math

import numpy as np
import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.physics.inertia import ZZ, inertia_of
from sim_vehicle.physics.layout import POINTS, Scratch, calm, constants_from, initial_state
from sim_vehicle.physics.record import new_record
from sim_vehicle.physics.rigid_body import runge_kutta_step
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.world import build_world
from tests.sim_vehicle.physics.throwing import first_hit, motors_off, quiet


@pytest.mark.parametrize("name", ["foldable", "rigid"])
@pytest.mark.parametrize("speed_m_s", [1.0, 2.5, 5.0])
@pytest.mark.parametrize("yaw_deg", [0, 20])
def test_the_walls_impulse_is_the_change_of_momentum(name: str, speed_m_s: float, yaw_deg: float) -> None:
    airframe = quiet(load_built_in(name))
    hit = first_hit(airframe, speed_m_s, yaw_rad=math.radians(yaw_deg))
    change = airframe.mass_kg * (np.array(hit.rebound_velocity_ned_m_s) - np.array(hit.impact_velocity_ned_m_s))
    assert hit.impulse_ned_n_s[0] == pytest.approx(change[0], rel=0.01)
    assert hit.impulse_ned_n_s[1] == pytest.approx(change[1], abs=0.01 * abs(change[0]))


def test_the_inertias_rate_is_its_slope() -> None:
    constants = constants_from(load_built_in("foldable"), np.random.default_rng(1))
    folds, rates, step_s = np.array([0.01, 0.02, 0.0, 0.03]), np.array([-0.5, 0.1, 0.3, -0.2]), 1e-6
    before, after, rate, unused = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    inertia_of(folds, rates, constants, before, rate)
    inertia_of(folds + step_s * rates, rates, constants, after, unused)
    assert (after - before) / step_s == pytest.approx(rate, rel=1e-3)


def test_arms_that_unfold_slow_a_spin_as_a_skaters_do() -> None:
    """No moment acts: J_zz times yaw rate stays while the arms return."""
    airframe = quiet(load_built_in("foldable"))
    plant = Plant(airframe, Scene(), seed=1)
    plant.place((0.0, 0.0, -50.0), (0.0, 0.0, 0.0))
    plant.state.body[12] = 10.0
    plant.state.fold_m[:4] = 0.03
    plant.step(None, armed=False)
    momentum, spin = plant.state.inertia[ZZ] * plant.state.body[12], plant.state.body[12]
    motors_off(plant, 0.4)
    assert plant.state.fold_m.max() == pytest.approx(airframe.arms.hysteresis_m)
    assert plant.state.body[12] < 0.85 * spin
    assert plant.state.inertia[ZZ] * plant.state.body[12] == pytest.approx(momentum, rel=1e-3)


def test_the_integrator_is_of_fourth_order() -> None:
    """A tumble with drag: halving the step divides the error by sixteen."""
    airframe = load_built_in("foldable")
    world = build_world(())
    constants = constants_from(airframe, np.random.default_rng(1))

    def tumbled(steps: int) -> np.ndarray:
        state = initial_state((0.0, 0.0, -50.0), 0.3)
        state.body[3:6], state.body[10:13] = [3.0, -1.0, 0.5], [6.0, -4.0, 5.0]
        state.motor_thrust_n[:4] = [2.0, 3.0, 2.5, 2.2]
        count = len(world.faces)
        behind, near = np.zeros((POINTS, count), np.int64), np.zeros(count, np.int64)
        forces = np.zeros((2, POINTS, count))
        for _ in range(steps):
            runge_kutta_step(
                state, behind, near, False, 0.5 / steps, constants, calm((0.0, 0.0, 0.0)),
                world.faces, np.zeros(0, np.int64), forces, new_record(Scratch),
            )  # fmt: skip
        return np.array(state.body)

    exact = tumbled(3200)
    errors = [np.abs(tumbled(steps) - exact).max() for steps in (25, 50, 100)]
    orders = [math.log2(errors[0] / errors[1]), math.log2(errors[1] / errors[2])]
    assert orders == pytest.approx([4.0, 4.0], abs=0.4)
