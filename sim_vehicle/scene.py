"""The `sim:` part of a mission file: which airframe starts where, among which walls, in which wind."""

import math
from typing import Annotated

from pydantic import Field, model_validator

from sim_vehicle.airframe import Airframe
from sim_vehicle.errors import SceneError
from sim_vehicle.faults.spec import Fault, overlapping
from sim_vehicle.obstacles import BoxSpec, Point, PoleSpec, WallSpec
from sim_vehicle.quantities import Vector3
from sim_vehicle.world import Obstacle, World, build_world, distance_m
from sim_vehicle.written import Finite, Part


class Start(Part):
    """Where the vehicle stands on the ground before it is armed; z is the ground's, 0."""

    position_ned_m: Point = (0.0, 0.0, 0.0)
    """In the world; z is 0."""
    yaw_deg: Finite = 0.0
    """Clockwise from north."""

    @model_validator(mode="after")
    def _on_the_ground(self) -> "Start":
        if self.position_ned_m[2] != 0.0:
            raise ValueError("position_ned_m must have z = 0: the vehicle starts standing on the ground")
        return self


class Scene(Part):
    """Everything about the simulated world that a mission file may state."""

    airframe: str = "foldable"
    """foldable, rigid, hexa, octo, racer, or the path of an airframe file."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Of every random number of the simulated vehicle."""
    start: Start = Start()
    wind_ned_m_s: Point = (0.0, 0.0, 0.0)
    """Steady; the direction it blows to."""
    walls: tuple[WallSpec, ...] = ()
    """Plates; level ones are ceilings and floors."""
    poles: tuple[PoleSpec, ...] = ()
    """Round bars."""
    boxes: tuple[BoxSpec, ...] = ()
    """Level boxes."""
    faults: tuple[Fault, ...] = ()
    """What goes wrong, and when."""

    @model_validator(mode="after")
    def _faults_fit(self) -> "Scene":
        problem = overlapping(self.faults)
        if problem is not None:
            raise ValueError(problem)
        return self

    def obstacles(self) -> tuple[tuple[str, Obstacle], ...]:
        """Everything that the vehicle can run into but the ground, each with its place in the file."""
        return tuple(
            (f"sim.{kind}.{index}", spec.built(index + 1))
            for kind in ("walls", "poles", "boxes")
            for index, spec in enumerate(getattr(self, kind))
        )

    def world(self) -> World:
        """Ground and obstacles as contact faces."""
        return build_world(tuple(obstacle for _, obstacle in self.obstacles()))


def check_start_is_free(scene: Scene, airframe: Airframe) -> None:
    """Raise SceneError, naming the obstacle and the remedy, if one passes through the standing vehicle."""
    x, y, _ = scene.start.position_ned_m
    standing: Vector3 = (x, y, -airframe.geometry.foot_depth_m)
    reach_m = airframe.geometry.reach_m
    for place, obstacle in scene.obstacles():
        away_m = distance_m(obstacle, standing, 0.0)
        if away_m < reach_m:
            raise SceneError(
                f"{place}: '{obstacle.name}' passes through the vehicle's start position "
                f"({away_m:.2f} m from its centre, which needs {reach_m:.2f} m); "
                "move it or sim.start.position_ned_m"
            )


def check_wind_can_be_held(scene: Scene, airframe: Airframe) -> None:
    """Raise SceneError if the steady wind is more than the vehicle can lean against."""
    north_m_s, east_m_s, down_m_s = scene.wind_ned_m_s
    across_n, down_n = airframe.drag_n_s_m * math.hypot(north_m_s, east_m_s), airframe.drag_n_s_m * down_m_s
    carried_n, most_n = airframe.weight_n + down_n, airframe.most_thrust_n
    if across_n > carried_n * math.tan(airframe.control.tilt_max_rad) or math.hypot(across_n, carried_n) > most_n:
        raise SceneError(
            f"wind_ned_m_s pushes {airframe.name} with {math.hypot(across_n, down_n):.1f} N, more than it can lean "
            "against; choose less wind, or an airframe with less drag"
        )
