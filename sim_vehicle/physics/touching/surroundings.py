"""What the kernels need of the world around the vehicle; another world may take its place in the middle of a flight."""

import numpy as np

from sim_vehicle.physics.layout import POINTS
from sim_vehicle.physics.touching.proximity import points_behind
from sim_vehicle.quantities import Vector3
from sim_vehicle.world import FACE_POINT, FACE_VELOCITY, World


class Surroundings:
    """A world as the kernels read it: rows, which of them move, and which parts of the vehicle have passed which."""

    def __init__(self, world: World, centre_ned_m: Vector3, time_us: int, interval_us: int) -> None:
        """``centre_ned_m``: the vehicle's centre, with no obstacle through the vehicle at that time."""
        self.world = world
        self.faces = world.faces
        # What a camera or a beam sees: poles and edges are too thin.
        self.flat_faces = world.faces[: world.flat_count]
        self.moving = np.array([row for mover in world.movers for row in mover.rows], np.int64)
        self._interval_us = interval_us
        self.move(time_us)
        self.behind = points_behind(self.faces, centre_ned_m)
        self.near = np.zeros(len(world.faces), np.int64)
        self.forces = np.zeros((2, POINTS, len(world.faces)))

    def changed(self, world: World, centre_ned_m: Vector3, time_us: int) -> "Surroundings":
        """Another world around the same vehicle, which has passed what it had passed of the obstacles that stay."""
        after = Surroundings(world, centre_ned_m, time_us, self._interval_us)
        before = world.rows_in(self.world)
        stays = before >= 0
        after.behind[:, stays] = self.behind[:, before[stays]]
        return after

    def move(self, time_us: int) -> None:
        """Put what moves where it is and give it the velocity that takes it to where it will be."""
        time_s, interval_s = 1e-6 * time_us, 1e-6 * self._interval_us
        for mover in self.world.movers:
            now_ned_m = np.array(mover.motion.offset_ned_m(time_s))
            then_ned_m = np.array(mover.motion.offset_ned_m(time_s + interval_s))
            self.faces[mover.rows, FACE_POINT : FACE_POINT + 3] = mover.points_ned_m + now_ned_m
            self.faces[mover.rows, FACE_VELOCITY : FACE_VELOCITY + 3] = (then_ned_m - now_ned_m) / interval_s
