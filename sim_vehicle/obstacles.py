"""Walls, poles and boxes as a mission file states them."""

import math
from itertools import pairwise
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from sim_vehicle.quantities import Vector3
from sim_vehicle.world import Box, Motion, Pole, plate
from sim_vehicle.written import Finite, NotNegative, Part

Point = tuple[Finite, Finite, Finite]


def _with_direction(vector: Vector3) -> Vector3:
    if math.hypot(*vector) < 1e-6:
        raise ValueError("has no direction; [-1, 0, 0] looks south, [0, 0, -1] stands upright")
    return vector


Direction = Annotated[Point, AfterValidator(_with_direction)]
Length = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]


class Waypoint(Part):
    """Where an obstacle is at a moment, against where it was described."""

    at_s: NotNegative
    """By the vehicle's boot clock."""
    offset_ned_m: Point
    """Against where the obstacle was described."""


class MotionSpec(Part):
    """How an obstacle moves: at a velocity for a while, or along a path; seconds of the vehicle's boot clock."""

    velocity_ned_m_s: Point | None = None
    """From from_s until until_s."""
    from_s: NotNegative = 0.0
    """Begins to move."""
    until_s: NotNegative = 3600.0
    """Stands from then on."""
    path: tuple[Waypoint, ...] = ()
    """Instead of a velocity: straight from one to the next."""

    @model_validator(mode="after")
    def _moves_one_way(self) -> Self:
        if (self.velocity_ned_m_s is None) == (not self.path):
            raise ValueError("motion needs either velocity_ned_m_s or path, and not both")
        if self.velocity_ned_m_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"motion ends (until_s {self.until_s:g}) before it begins (from_s {self.from_s:g})")
        times = [waypoint.at_s for waypoint in self.path]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError("path: each at_s must be later than the one before")
        return self

    def motion(self) -> Motion:
        """The same as a path."""
        if self.velocity_ned_m_s is None:
            return Motion(
                tuple(waypoint.at_s for waypoint in self.path), tuple(waypoint.offset_ned_m for waypoint in self.path)
            )
        x, y, z = (axis * (self.until_s - self.from_s) for axis in self.velocity_ned_m_s)
        return Motion((self.from_s, self.until_s), ((0.0, 0.0, 0.0), (x, y, z)))


class ObstacleSpec(Part):
    """What every obstacle may have."""

    name: str | None = None
    """As reports and pictures have it."""
    motion: MotionSpec | None = None
    """Of an obstacle that does not stand still."""

    def _motion(self) -> Motion | None:
        return None if self.motion is None else self.motion.motion()


class WallSpec(ObstacleSpec):
    """A solid plate: its front face's centre, the direction it faces, its size. Level ones are ceilings and floors."""

    point_ned_m: Point
    """Centre of its front face."""
    normal_ned: Direction
    """The direction that the face looks, of any length."""
    width_m: Length = 10.0
    """Along its level edges."""
    height_m: Length = 10.0
    """Along the other two."""
    thickness_m: Length = 0.1
    """Behind the face."""

    def built(self, number: int) -> Box:
        """The same as a value, with its normal made unit and a name if it had none."""
        name, size_m = self.name or f"wall {number}", (self.width_m, self.height_m)
        return plate(name, self.point_ned_m, unit(self.normal_ned), size_m, self.thickness_m, self._motion())


class PoleSpec(ObstacleSpec):
    """A round bar: where it stands, which way it goes from there, how far and how thick."""

    point_ned_m: Point
    """Where it stands."""
    axis_ned: Direction = (0.0, 0.0, -1.0)
    """Which way it goes from there, of any length."""
    height_m: Length = 5.0
    """Its length."""
    radius_m: Annotated[float, Field(ge=0.005, le=100, allow_inf_nan=False)] = 0.1
    """Its half thickness."""

    def built(self, number: int) -> Pole:
        """The same as a value, with its axis made unit and a name if it had none."""
        return Pole(
            name=self.name or f"pole {number}",
            foot_ned_m=self.point_ned_m,
            axis_ned=unit(self.axis_ned),
            height_m=self.height_m,
            radius_m=self.radius_m,
            motion=self._motion(),
        )


class BoxSpec(ObstacleSpec):
    """A level box: its middle, its size before it is turned, and its heading."""

    centre_ned_m: Point
    """Its middle."""
    size_m: tuple[Length, Length, Length]
    """North, east and down before it is turned."""
    yaw_deg: Finite = 0.0
    """By which it is turned, clockwise."""

    def built(self, number: int) -> Box:
        """The same as a value, with a name if it had none."""
        cosine, sine = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return Box(
            name=self.name or f"box {number}",
            centre_ned_m=self.centre_ned_m,
            axes_ned=((cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)),
            sizes_m=self.size_m,
            motion=self._motion(),
        )


def unit(vector: Vector3) -> Vector3:
    """The direction of a vector that has one."""
    length = math.hypot(*vector)
    x, y, z = vector
    return x / length, y / length, z / length
