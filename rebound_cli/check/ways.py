"""The ways of a mission as points in time, and what of the simulated world stands in them."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.mission.itinerary import Leg, itinerary
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld
from sim_vehicle.airframe import Airframe
from sim_vehicle.scene import Scene

Floats = npt.NDArray[np.float64]

# Points this far apart show every bend, and miss no wall.
_STEP_M = 0.05
_MOST_POINTS = 2_000


@dataclass(frozen=True, slots=True)
class Meeting:
    """The first obstacle in a way, and at which of its points."""

    name: str
    index: int


@dataclass(frozen=True, slots=True)
class Way:
    """A leg with its place in time. `begins_s` is None once a wait without a known end lies before it."""

    leg: Leg
    begins_s: float | None
    points_ned_m: Floats  # (n, 3), mission coordinates; one point where the vehicle stays
    fractions: Floats  # (n,), of the leg's time
    meets: Meeting | None

    @property
    def length_m(self) -> float:
        return 0.0 if self.leg.way is None else self.leg.way.distance_m

    @property
    def ends_s(self) -> float | None:
        return None if self.begins_s is None or self.leg.lasts_s is None else self.begins_s + self.leg.lasts_s


def planned_ways(mission: Mission, world: SimulatedWorld) -> tuple[Way, ...]:
    """All steps in order, when nothing is hit."""
    begins_s: float | None = 0.0
    ways: list[Way] = []
    for leg in itinerary(mission):
        way, fractions, points = leg.way, np.zeros(1), np.array([leg.start_ned_m])
        if way is not None and way.duration_s > 0.0:
            fractions = np.linspace(0.0, 1.0, min(_MOST_POINTS, max(2, math.ceil(way.distance_m / _STEP_M))) + 1)
            points = np.array([way.at(fraction * way.duration_s)[0] for fraction in fractions])
        ways.append(Way(leg, begins_s, points, fractions, _first_met(points, world.scene, world.airframe)))
        begins_s = ways[-1].ends_s
    return tuple(ways)


def _first_met(points_ned_m: Floats, scene: Scene, airframe: Airframe) -> Meeting | None:
    """The first obstacle, where it stands at first, that a vehicle on these points touches."""
    # The arming position is that of the vehicle's centre as it stands.
    (north_m, east_m, _), standing_m = scene.start.position_ned_m, airframe.geometry.foot_depth_m
    for index, (north, east, down) in enumerate(points_ned_m.tolist()):
        place = (north + north_m, east + east_m, down - standing_m)
        for _, obstacle in scene.obstacles():
            if obstacle.distance_m(place) < airframe.geometry.reach_m:
                return Meeting(obstacle.name, index)
    return None
