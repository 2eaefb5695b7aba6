"""What a .plan of QGroundControl looks like: the parts that are read, and MAVLink's numbers in them.

Source: QGroundControl's developer guide, "Plan File Format".
"""

from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Strict, Tag

# MAV_CMD
WAYPOINT, LOITER_TURNS, LOITER_TIME, RETURN_TO_LAUNCH, LAND, TAKEOFF = 16, 18, 19, 20, 21, 22
DELAY, CONDITION_DELAY, CONDITION_YAW, JUMP, CHANGE_SPEED = 93, 112, 115, 177, 178
# Cameras, gimbals and regions of interest: they do not change where the vehicle flies.
BESIDE_THE_WAY = (*range(195, 198), 200, 201, *range(203, 207), 214, *range(530, 533), 1000, 2000, 2001, 2500, 2501)
# MAV_FRAME
FRAME_ABOVE_SEA, FRAME_ABOVE_HOME = (0, 5), (3, 6)

# Far beyond any angle, height or time that means something, and small enough to be computed with.
_MOST = 1e7

Number: TypeAlias = Annotated[float, Field(ge=-_MOST, le=_MOST)]
Latitude: TypeAlias = Annotated[float, Field(ge=-90, le=90)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180, le=180)]
# Not strict: JSON has lists where this has tuples.
LatLon: TypeAlias = Annotated[tuple[Latitude, Longitude], Strict(False)]
Whole: TypeAlias = Annotated[int, Field(ge=0, le=65_535)]


class _Part(BaseModel):
    # Strict: the reader counts on numbers being numbers. NaN has no place in JSON.
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class SimpleItem(_Part):
    """One command."""

    type: Literal["SimpleItem"]
    params: Annotated[list[Number | None], Field(min_length=7, max_length=7)]
    command: Whole
    frame: Whole
    doJumpId: Whole = 0  # noqa: N815 - QGroundControl's names

    def value(self, number: int) -> float:
        """MAVLink's param1 to param7; 0 where the plan says nothing."""
        return self.params[number - 1] or 0.0


class Transect(_Part):
    Items: list[SimpleItem] | None = None


class ComplexItem(_Part):
    """A survey or another pattern, or what no version of QGroundControl has written so far."""

    type: str | None = None
    complexItemType: str | None = None  # noqa: N815
    TransectStyleComplexItem: Transect = Transect()


def _kind(item: object) -> str:
    return "simple" if isinstance(item, dict) and item.get("type") == "SimpleItem" else "complex"


Item: TypeAlias = Annotated[
    Annotated[SimpleItem, Tag("simple")] | Annotated[ComplexItem, Tag("complex")], Discriminator(_kind)
]


class MissionPart(_Part):
    plannedHomePosition: Annotated[list[Number], Field(min_length=2, max_length=3)]  # noqa: N815
    hoverSpeed: Number | None = None  # noqa: N815
    items: Annotated[list[Item], Field(min_length=1)]


class Circle(_Part):
    radius: Annotated[float, Field(gt=0, le=_MOST)]
    center: LatLon


class _Fence(_Part):
    inclusion: bool = True


class CircleFence(_Fence):
    circle: Circle


class PolygonFence(_Fence):
    polygon: list[LatLon]


class GeoFence(_Part):
    circles: list[CircleFence] = []
    polygons: list[PolygonFence] = []


class PlanShape(_Part):
    fileType: Literal["Plan"]  # noqa: N815
    mission: MissionPart
    geoFence: GeoFence | None = None  # noqa: N815
    rallyPoints: dict[str, object] | None = None  # noqa: N815
