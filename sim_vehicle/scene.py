"""The `sim:` part of a mission file: which airframe starts where, among which walls, in which wind."""

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from sim_vehicle.airframe import Airframe
from sim_vehicle.errors import SceneError
from sim_vehicle.world import Vector3, Wall, World, build_world, distance_to_wall

Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Length = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class WallSpec(_Part):
    """A solid plate: its front face's centre, the direction it faces, its size."""

    name: str | None = None
    point_ned_m: Point
    normal_ned: Point
    width_m: Length = 10.0
    height_m: Length = 10.0
    thickness_m: Length = 0.1

    @model_validator(mode="after")
    def _has_direction(self) -> "WallSpec":
        if math.hypot(*self.normal_ned) < 1e-6:
            raise ValueError("normal_ned has no direction; give the way the face looks, e.g. [-1, 0, 0]")
        return self

    def wall(self, number: int) -> Wall:
        """The same as a value, with its normal made unit and a name if it had none."""
        length = math.hypot(*self.normal_ned)
        x, y, z = self.normal_ned
        return Wall(
            name=self.name or f"wall {number}",
            point_ned_m=self.point_ned_m,
            normal_ned=(x / length, y / length, z / length),
            width_m=self.width_m,
            height_m=self.height_m,
            thickness_m=self.thickness_m,
        )


class Start(_Part):
    """Where the vehicle stands on the ground before it is armed; z is the ground's, 0."""

    position_ned_m: Point = (0.0, 0.0, 0.0)
    yaw_deg: Finite = 0.0

    @model_validator(mode="after")
    def _on_the_ground(self) -> "Start":
        if self.position_ned_m[2] != 0.0:
            raise ValueError("position_ned_m must have z = 0: the vehicle starts standing on the ground")
        return self


class Scene(_Part):
    """Everything about the simulated world that a mission file may state."""

    airframe: str = "foldable"
    seed: Annotated[int, Field(ge=0)] = 1
    start: Start = Start()
    wind_ned_m_s: Point = (0.0, 0.0, 0.0)
    walls: tuple[WallSpec, ...] = ()

    def walls_built(self) -> tuple[Wall, ...]:
        """The walls as values, in the file's order."""
        return tuple(spec.wall(number) for number, spec in enumerate(self.walls, start=1))

    def world(self) -> World:
        """Ground and walls as contact faces."""
        return build_world(self.walls_built())


def check_start_is_free(scene: Scene, airframe: Airframe) -> None:
    """Raise SceneError, naming the wall and the remedy, if one passes through the standing vehicle."""
    x, y, _ = scene.start.position_ned_m
    centre: Vector3 = (x, y, -airframe.geometry.foot_depth_m)
    reach_m = airframe.geometry.reach_m
    for number, wall in enumerate(scene.walls_built()):
        distance_m = distance_to_wall(wall, centre)
        if distance_m < reach_m:
            raise SceneError(
                f"sim.walls.{number}: '{wall.name}' passes through the vehicle's start position "
                f"({distance_m:.2f} m from its centre, which needs {reach_m:.2f} m); "
                "move the wall or sim.start.position_ned_m"
            )
