"""Another world around the same vehicle: what is known of the obstacles that stay is not forgotten."""

import numpy as np

from sim_vehicle.physics.touching.proximity import IN_FRONT, INSIDE, PASSED
from sim_vehicle.physics.touching.surroundings import Surroundings
from sim_vehicle.world import Box, Motion, Obstacle, Pole, build_world, plate

STEP_US = 4000
HERE = (0.0, 0.0, -2.0)
MAST = Pole("mast", (2.0, 0.0, 0.0), (0.0, 0.0, -1.0), 5.0, 0.1)


def wall(north_m: float, motion: Motion | None = None) -> Box:
    return plate("wall", (north_m, 0.0, -2.0), (-1.0, 0.0, 0.0), (4.0, 4.0), 0.1, motion)


def rows_of(around: Surroundings, obstacle: Obstacle) -> np.ndarray:
    return np.flatnonzero(around.world.owners == around.world.obstacles.index(obstacle))


def test_what_a_part_has_passed_it_has_still_passed_when_other_obstacles_come_and_go() -> None:
    first, second = wall(1.0), wall(-3.0)
    around = Surroundings(build_world((first, MAST)), HERE, 0, STEP_US)
    around.behind[:, rows_of(around, MAST)] = INSIDE
    around.behind[2, rows_of(around, first)[0]] = PASSED
    around = around.changed(build_world((second, first, MAST)), HERE, 0)
    around = around.changed(build_world((MAST, first)), HERE, 0)
    assert np.all(around.behind[:, rows_of(around, MAST)] == INSIDE)
    front = rows_of(around, first)[0]
    assert around.behind[2, front] == PASSED and around.behind[1, front] == IN_FRONT
