"""The ways of a mission as points in time, and what of the simulated world stands in them."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from companion.mission.model import Leg, Mission, itinerary
from rebound_cli.inputs.inputs import SimulatedWorld
from sim_vehicle.airframe import Airframe
from sim_vehicle.quantities import Floats, Vector3
from sim_vehicle.scene import Scene
from sim_vehicle.world import Obstacle

# Points this far apart show every bend, and miss no wall.
_STEP_M = 0.05
_MOST_POINTS = 2_000


@dataclass(frozen=True, slots=True)
class Meeting:
    """The first obstacle in a way, and at which of its points. One that moves may be there, or not, when it comes."""

    name: str
    index: int
    moves: bool


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """A leg with its place in time. `begins_s` is None once a wait without a known end lies before it."""

    leg: Leg
    begins_s: float | None
    points_ned_m: Floats  # (n, 3), mission coordinates; one point where the vehicle stays
    fractions: Floats  # (n,), of the leg's time
    meets: Meeting | None

    @property
    def length_m(self) -> float:
        return 0.0 if self.leg.trajectory is None else self.leg.trajectory.distance_m

    @property
    def ends_s(self) -> float | None:
        return None if self.begins_s is None or self.leg.lasts_s is None else self.begins_s + self.leg.lasts_s


def flown_legs(mission: Mission, world: SimulatedWorld) -> tuple[FlownLeg, ...]:
    """All steps in order, when nothing is hit."""
    begins_s: float | None = 0.0
    legs: list[FlownLeg] = []
    for leg in itinerary(mission):
        trajectory, fractions, points = leg.trajectory, np.zeros(1), np.array([leg.start_ned_m])
        if trajectory is not None and trajectory.duration_s > 0.0:
            fractions = np.linspace(0.0, 1.0, min(_MOST_POINTS, max(2, math.ceil(trajectory.distance_m / _STEP_M))) + 1)
            points = np.array([trajectory.at(fraction * trajectory.duration_s)[0] for fraction in fractions])
        legs.append(FlownLeg(leg, begins_s, points, fractions, _first_met(points, world.scene, world.airframe)))
        begins_s = legs[-1].ends_s
    return tuple(legs)


def _first_met(points_ned_m: Floats, scene: Scene, airframe: Airframe) -> Meeting | None:
    """The first obstacle, wherever it stands in its time, that a vehicle on these points touches."""
    # The arming position is that of the vehicle's centre as it stands.
    (north_m, east_m, _), standing_m = scene.start.position_ned_m, airframe.geometry.foot_depth_m
    for index, (north, east, down) in enumerate(points_ned_m.tolist()):
        place = (north + north_m, east + east_m, down - standing_m)
        for _, obstacle in scene.obstacles():
            if _nearest_m(obstacle, place) < airframe.geometry.reach_m:
                return Meeting(obstacle.name, index, obstacle.motion is not None)
    return None


def _nearest_m(obstacle: Obstacle, place_ned_m: Vector3) -> float:
    """How near an obstacle comes to a place."""
    if obstacle.motion is None:
        return obstacle.distance_m(place_ned_m)

    def distance_m(offset_ned_m: Floats) -> float:
        north, east, down = (np.array(place_ned_m) - offset_ned_m).tolist()
        return obstacle.distance_m((north, east, down))

    nearest_m = math.inf
    for start, end in pairwise(map(np.array, obstacle.motion.offsets_ned_m)):
        # On a straight way the distance from a convex solid has one least value: thirds close in on it.
        low, high = 0.0, 1.0
        while (high - low) * np.linalg.norm(end - start) > _STEP_M:
            near, far = low + (high - low) / 3, high - (high - low) / 3
            if distance_m(start + near * (end - start)) < distance_m(start + far * (end - start)):
                high = far
            else:
                low = near
        nearest_m = min(nearest_m, distance_m(start + 0.5 * (low + high) * (end - start)))
    return nearest_m
